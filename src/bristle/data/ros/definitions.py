"""Types of the messages of a topic, checked before rosbags makes code of them.

Names are plain and fields few; constants and defaults are left out, and definitions in IDL are not parsed.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from itertools import islice
from typing import Any

from bristle.data.columns import reading
from bristle.data.ros.bag import DAMAGED, Topic
from bristle.errors import InputError, short

_STAMPS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_BASE, _MESSAGE, _ARRAY, SEQUENCE = range(1, 5)  # kinds of fields, as in rosbags
_LONGEST, _MOST_FIELDS = 500_000, 2000  # characters of a definition; fields, with texts and messages of fixed arrays
_NO_FIELD = "structure_needs_at_least_one_member"  # of an empty message, which takes a byte in CDR and none in ROS 1
_MOST_ELEMENTS, _DEEPEST = 10**7, 4  # of an array of any length; messages in messages
_TYPE = re.compile(r"[A-Za-z]\w{0,99}(/[A-Za-z]\w{0,99}){1,3}", re.ASCII)

Types = Mapping[str, Mapping[str, Any]]  # the fields of each type by name, each as (form, inner) of rosbags


@lru_cache(maxsize=64)
def types_of(topic: Topic) -> Types:
    """The types in a topic's messages: as the bag defines them, else as ROS 2 does.

    Raises InputError where the definition cannot be parsed, a type is not known, or it could do harm.
    """
    if not topic.kind:
        raise InputError(f"topic {topic.name} has messages of several types; record one, or name another topic")
    if topic.encoding not in ("cdr", "ros1"):
        got = f"topic {topic.name} has messages in {short(topic.encoding)}"
        raise InputError(f"{got}; expected cdr or ros1, as ROS writes them")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    def refused(why: str) -> InputError:
        return InputError(f"topic {topic.name}: its message definition {why}; {DAMAGED}")

    given: Mapping[str, Any] = {}
    if topic.definition and not topic.is_idl:
        if len(topic.definition) > _LONGEST:
            raise refused(f"has over {_LONGEST} characters")
        with reading(f"message definition of topic {topic.name}", DAMAGED):
            given = get_types_from_msg(topic.definition, topic.kind)
    known = get_typestore(Stores.LATEST).fielddefs
    types, size, ahead = dict[str, dict[str, Any]](), 0, [topic.kind]
    while ahead:
        kind = ahead.pop()
        found = known.get(kind) if kind in _STAMPS else given.get(kind) or known.get(kind)
        if found is None:
            why = "is defined in IDL, which is not read" if topic.is_idl else "is not defined in the bag"
            own = "nor one of ROS 2's own; record with definitions (MCAP)"
            raise InputError(f"topic {topic.name}: its type {short(kind)} {why}, {own}")
        types[kind] = fields = dict(found[1])
        empty = topic.encoding == "ros1" and kind != topic.kind and fields.keys() <= {_NO_FIELD}
        if not _TYPE.fullmatch(kind) or len(fields) < len(found[1]) or empty:
            raise refused(f"has an odd name, one name twice, or no field, in {short(kind)}")
        for form, inner in fields.values():
            element, count = inner if form in (_ARRAY, SEQUENCE) else ((form, inner), 1)
            size += count if form == _ARRAY and not _is_number(element) else 1
            ahead += [element[1]] if element[0] == _MESSAGE and element[1] not in types else []
        if size > _MOST_FIELDS:
            raise refused(f"has over {_MOST_FIELDS} fields")
    return types


def fields_of(topic: Topic) -> dict[str, bool]:
    """Names of the numbers and times in a topic's messages, as `points[].positions[]`, each with whether it is a time."""
    types = types_of(topic)

    def within(kind: str, before: str, depth: int) -> Iterator[tuple[str, bool]]:
        for field, (form, inner) in types[kind].items():
            is_array = form in (_ARRAY, SEQUENCE)
            part = inner[0] if is_array else (form, inner)
            name, is_time = f"{before}{field}{'[]' * is_array}", part[1] in _STAMPS
            if is_time or _is_number(part):
                yield name, is_time
            elif part[0] == _MESSAGE and depth < _DEEPEST:
                yield from within(part[1], f"{name}.", depth + 1)

    return dict(islice(within(topic.kind, "", 0), _MOST_FIELDS))


def _is_number(part: Any) -> bool:
    return bool(part[0] == _BASE and part[1][0] != "string")


def decoder_of(topic: Topic) -> Callable[[bytes], Any]:
    """The decoder of a topic's messages. Raises InputError as `types_of`."""
    from rosbags.typesys.store import Typestore

    store = Typestore(max_sequence_length=_MOST_ELEMENTS)
    with reading(f"message definition of topic {topic.name}", DAMAGED):
        store.register({kind: ([], list(fields.items())) for kind, fields in types_of(topic).items()})
        store.get_msgdef(topic.kind)
    decode = store.deserialize_cdr if topic.encoding == "cdr" else store.deserialize_ros1
    return lambda raw: decode(raw, topic.kind)
