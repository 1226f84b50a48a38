"""YAML without its surprises: 1e4 is a number, 017, 1_000 and 1:30 are not, and no key occurs twice."""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import yaml

from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import TEXT_BYTES

_FLOAT = re.compile(r"^[-+]?(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][-+]?\d+)?$|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$")
_INT = re.compile(r"^[-+]?(0|[1-9]\d{,400})$")  # more digits than any number has are a text
_RULES = (("float", _FLOAT), ("int", _INT))
_KEPT = {"tag:yaml.org,2002:bool", "tag:yaml.org,2002:null"}  # of PyYAML's rules; a date is a text
MOST_DEPTH, MOST_NODES = 20, 50_000
LONG = 60  # characters that a refusal shows of a name


class _Loader(yaml.SafeLoader):
    """SafeLoader with the numbers of YAML 1.2 and unique keys; without tags, anchors and directives.

    They say nothing that a scene could need, and cost whatever their author wants: a list of lists of aliases is larger
    than any memory.
    """

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = self._nodes = 0

    def compose_document(self) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if event.version or event.tags:
            raise Refused(f"line {event.start_mark.line + 1}: a directive; allowed: none")
        return super().compose_document()

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        self._depth, self._nodes = self._depth + 1, self._nodes + 1
        where = f"line {event.start_mark.line + 1}: "
        if event.anchor is not None:
            raise Refused(f"{where}an anchor or alias, {event.anchor[:LONG]}; allowed: none")
        if event.tag is not None:
            raise Refused(f"{where}a tag, {event.tag[:LONG]}; allowed: none")
        if self._depth > MOST_DEPTH:
            raise Refused(f"{where}nested too deeply; allowed: {MOST_DEPTH} levels")
        if self._nodes > MOST_NODES:
            raise Refused(f"{where}more than {MOST_NODES} keys and values; allowed: at most that")
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


class _Dumper(yaml.SafeDumper):
    """SafeDumper that quotes what our loader, or another one, would take for a number."""


_Loader.yaml_implicit_resolvers = {
    first: [rule for rule in rules if rule[0] in _KEPT]
    for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _class in (_Loader, _Dumper):
    for _kind, _pattern in _RULES:
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", _pattern, list("-+0123456789."))


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    result: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, Hashable):
            raise Refused(f"{key!r} is a key; allowed: texts as keys")
        if key in result:
            raise Refused(f"line {key_node.start_mark.line + 1}: {key}: the key occurs twice; allowed: once")
        result[key] = loader.construct_object(value_node, deep=True)
    return result


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)


def load(text: str) -> Any:
    """Read one document; what is not strict YAML, or too large, is refused."""
    if len(text) > TEXT_BYTES:
        raise Refused(f"larger than {TEXT_BYTES} characters; allowed: at most that")
    try:
        loader = _Loader(text)
        return loader.get_single_data()
    except Refused:
        raise
    except yaml.YAMLError as error:
        raise Refused(" ".join(str(error).split()).replace(' in "<unicode string>",', " at")) from None
    except (ValueError, OverflowError) as error:  # PyYAML's for "\UFFFFFFFF"
        raise Refused(f"line {loader.line + 1}: a value cannot be read: {error}") from None


def dump(document: Any) -> str:
    """Write a document so that `load` gives the same one back."""
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
