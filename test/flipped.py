"""A copy of a bag in which one bit of a state is another one."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer

FROM_THE_END = 72  # bytes of a message of joint_states: where the last of three positions begins


def with_a_flipped_bit(old: Path, new: Path, topic: str, row: int) -> Path:
    """Another MCAP file with the same records, but for the lowest bit of the last position in one message of a topic.

    All checksums are right.
    """
    with old.open("rb") as source, new.open("wb") as target:
        reader = make_reader(source)
        writer = Writer(target, enable_data_crcs=True)
        writer.start(profile=reader.get_header().profile)
        records = {record.name: record for record in reader.iter_metadata()}
        writer.add_metadata("grasp_ros", records.pop("grasp_ros").metadata)
        schemas, channels, count = {}, {}, Counter[str]()
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata)
            data = bytearray(message.data)
            if channel.topic == topic and count[topic] == row:
                data[-FROM_THE_END] ^= 1
            count[channel.topic] += 1
            writer.add_message(channels[channel.id], message.log_time, bytes(data), message.publish_time,
                               message.sequence)
        for name, record in records.items():
            writer.add_metadata(name, record.metadata)
        writer.finish()
    return new
