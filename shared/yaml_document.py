"""Read YAML that people write (JSON is YAML): safely, strictly, and bounded in what aliases can blow up."""

from __future__ import annotations

import re
from typing import Any

import yaml

MOST_NODES = 500_000
"""Values of a document once its aliases are written out."""


class YamlError(ValueError):
    """Not YAML, or YAML that cannot be meant; the message says where."""


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """PyYAML's safe loader, with two changes.

    A key given twice is an error: the first would be lost without a word. And 1e-3 is a number, as in YAML 1.2 and
    JSON; PyYAML wants 1.0e-3.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """As in PyYAML, after looking for keys that come twice."""
        seen: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in seen:
                raise yaml.constructor.ConstructorError(None, None, f"{name!r} is given twice", key.start_mark)
            seen.add(name)
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        return mapping


_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


def read_yaml(text: str) -> Any:
    """The value of a document.

    Raises
    ------
    YamlError
        Not YAML, a key given twice, nested too deep, or aliases that hold themselves or multiply beyond `MOST_NODES`.
    """
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        if _written_out(node, {}) > MOST_NODES:
            raise YamlError(f"more than {MOST_NODES} values once its aliases are written out")
        return loader.construct_document(node)
    except yaml.YAMLError as error:
        raise YamlError(_where(error)) from error
    except RecursionError:
        raise YamlError("nested too deep") from None
    except YamlError:
        raise
    except Exception as error:  # `!!timestamp x`, 2020-99-99: the loader lets out whatever the conversion raises
        raise YamlError(f"a value that is not what its tag says ({type(error).__name__}: {error})") from error
    finally:
        loader.dispose()


def _written_out(node: yaml.Node, known: dict[int, int | None]) -> int:
    """Number of values below a node, counting an alias as often as it is used."""
    if id(node) in known:
        count = known[id(node)]
        if count is None:
            raise YamlError("an alias holds itself")
        return count
    known[id(node)] = None
    below: list[yaml.Node] = []
    if isinstance(node, yaml.SequenceNode):
        below = node.value
    elif isinstance(node, yaml.MappingNode):
        below = [part for pair in node.value for part in pair]
    count = 1 + sum(_written_out(child, known) for child in below)
    known[id(node)] = count
    return count


def _where(error: yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        mark = error.problem_mark
        return f"line {mark.line + 1}, column {mark.column + 1}: {error.problem or error.context}"
    return str(error)
