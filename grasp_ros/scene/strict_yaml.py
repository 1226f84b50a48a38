"""YAML without its surprises: 1e4 is a number, 017, 1_000 and 1:30 are not, and no key stands twice."""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import yaml

from grasp_ros.physics.errors import Refused

_FLOAT = re.compile(r"^[-+]?(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][-+]?\d+)?$|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$")
_INT = re.compile(r"^[-+]?(0|[1-9]\d*)$")
_RULES = (("float", _FLOAT), ("int", _INT))
MISFITS = (ValueError, LookupError, AttributeError)  # what PyYAML raises for 2001-13-45, `!!bool x`, `!!timestamp x`
_NUMERIC = {f"tag:yaml.org,2002:{kind}" for kind, _ in _RULES}


class _Loader(yaml.SafeLoader):
    """SafeLoader with the numbers of YAML 1.2 and unique keys."""


class _Dumper(yaml.SafeDumper):
    """SafeDumper that quotes what the loader would take for a number."""


for _class in (_Loader, _Dumper):
    _class.yaml_implicit_resolvers = {
        first: [rule for rule in rules if rule[0] not in _NUMERIC]
        for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    for _kind, _pattern in _RULES:
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", _pattern, list("-+0123456789."))


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    result: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, Hashable):
            raise Refused(f"{key!r} is a key; allowed: texts as keys")
        if key in result:
            raise Refused(f"{key}: the key stands twice; allowed: once")
        result[key] = loader.construct_object(value_node, deep=True)
    return result


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)


def load(text: str) -> Any:
    """Read one document.

    Raises
    ------
    Refused
        If the text is not YAML, a key stands twice, or a key is a list or a mapping.
    """
    try:
        return yaml.load(text, _Loader)
    except Refused:
        raise
    except yaml.YAMLError as error:
        raise Refused(" ".join(str(error).split())) from None
    except MISFITS as error:
        raise Refused(f"a value cannot be read: {error}") from None
    except RecursionError:
        raise Refused("nested too deeply") from None


def dump(document: Any) -> str:
    """Write a document so that `load` gives the same one back."""
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
