"""Types without ROS. What is compared with was made by ROS 2 Jazzy itself: the hashes by rosidl, the bytes by rclpy."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.ros2.transport.interfaces import RISE_INTERFACES, SHARE_FOLDER, InterfaceCatalog
from rise_adapters.ros2.transport.port import CANCEL_TYPE, STATUS_TYPE, PortError, action_types
from rise_adapters.ros2.transport.rclpy.types import InstalledTypes

pytest.importorskip("rosbags", reason="the standard definitions come with the extra dds")

DATA = Path(__file__).parent / "data"
HASHES: dict[str, str] = json.loads((DATA / "type_hashes.json").read_text(encoding="utf-8"))
MESSAGES: list[dict[str, Any]] = json.loads((DATA / "cdr.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def types() -> InterfaceCatalog:
    return InterfaceCatalog(environment={})


def share(folder: Path, **files: str) -> InterfaceCatalog:
    """A folder of a user's own definitions: `A` gives `lab/msg/A.msg`, `A_action` gives `lab/action/A.action`."""
    for name, text in files.items():
        name, _, kind = name.partition("_")
        path = folder / "lab" / (kind or "msg") / f"{name}.{kind or 'msg'}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return InterfaceCatalog([folder], environment={})


# --- hashes --------------------------------------------------------------------------------------------------------


def test_hashes_are_those_of_ros(types: InterfaceCatalog) -> None:
    assert len(HASHES) > 150
    assert {name: types.type_hash(name) for name in HASHES} == HASHES


def test_every_shipped_type_has_an_official_hash() -> None:
    files = [
        path
        for folder in (SHARE_FOLDER, RISE_INTERFACES)
        for path in folder.rglob("*.*")
        if path.suffix in (".msg", ".srv", ".action")
    ]
    assert len(files) >= 20
    names = {f"{path.parts[-3]}/{path.parts[-2]}/{path.stem}" for path in files}
    assert names - set(HASHES) == set()


def test_a_published_hash(types: InterfaceCatalog) -> None:
    """As `ros2 topic info -v` shows it of any Jazzy talker."""
    published = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert types.type_hash("std_msgs/msg/String") == published


def test_comments_constants_and_defaults_do_not_count(tmp_path: Path) -> None:
    types = share(
        tmp_path,
        A="uint8 LOW=1\nuint8 level 3  # how much\n\nstring<=5[<=2] names ['a', \"b\"]\n",
        B="# other words\nuint8 level\nstring<=5[<=2] names\n",
    )
    assert len(types.type_hash("lab/msg/A")) == len("RIHS01_") + 64
    assert types.fields("lab/msg/A") == types.fields("lab/msg/B") == {"level": "uint8", "names": "string<=5[<=2]"}


def test_char_is_another_name_of_uint8(types: InterfaceCatalog, tmp_path: Path) -> None:
    assert types.fields("service_msgs/msg/ServiceEventInfo")["client_gid"] == "uint8[16]"
    own = share(tmp_path, A="char letter\nchar[] letters\n")
    assert own.fields("lab/msg/A") == {"letter": "uint8", "letters": "uint8[]"}


# --- bytes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sample", MESSAGES, ids=[f"{number}-{one['type']}" for number, one in enumerate(MESSAGES)])
def test_bytes_are_those_of_ros(types: InterfaceCatalog, sample: dict[str, Any]) -> None:
    codec, official = types.codec(sample["type"]), bytes.fromhex(sample["cdr"])
    assert codec.pack(sample["message"]) == official + bytes(-len(official) & 3)
    assert json.loads(json.dumps(codec.unpack(official), default=list)) == sample["message"]


@pytest.mark.slow
def test_bytes_are_those_of_another_writer(types: InterfaceCatalog) -> None:
    """All standard messages, with zeros, and against a second, independent implementation."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    names = [name for name in store.fielddefs if "/msg/" in name]
    assert len(names) > 150
    for name in names:
        zeros = types.codec(name).pack({})
        message = store.deserialize_cdr(zeros, name)
        again = bytes(store.serialize_cdr(message, name))
        assert again + bytes(-len(again) & 3) == zeros, name
        assert types.codec(name).pack(types.codec(name).unpack(zeros)) == zeros


def test_what_is_left_out_is_zero_and_what_arrives_is_complete(types: InterfaceCatalog) -> None:
    codec = types.codec("geometry_msgs/msg/PointStamped")
    assert codec.unpack(codec.pack({"point": {"y": 2}})) == {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "point": {"x": 0.0, "y": 2.0, "z": 0.0},
    }
    goal = types.codec("rise_interfaces/action/Emotion_SendGoal_Request")
    assert goal.unpack(goal.pack({}))["goal_id"] == {"uuid": bytes(16)}


def test_every_shape_of_field_comes_back(tmp_path: Path) -> None:
    types = share(
        tmp_path,
        Inner="int8 a\nstring text\nfloat64 b\n",
        All=(
            "bool yes\nbool[3] three\nbool[] some\nbyte octet\nbyte[2] two\nuint8[] bytes\nint64 big\nuint64[] bigs\n"
            "int16[<=4] few\nfloat32 single\nfloat64[2] doubles\nstring text\nstring[2] pair\nstring<=4[] short\n"
            "Inner inner\nInner[2] inners\nInner[] more\nlab/Inner[<=1] most\nint8 last\n"
        ),
    )
    inner = {"a": -1, "text": "ä", "b": 0.5}
    message = {
        "yes": True,
        "three": [True, False, True],
        "some": [False],
        "octet": 255,
        "two": b"\x01\x02",
        "bytes": b"abc",
        "big": -(2**63),
        "bigs": [2**64 - 1],
        "few": [-5, 5, 0],
        "single": 0.25,
        "doubles": [math.pi, -0.0],
        "text": "x",
        "pair": ["", "two"],
        "short": ["äb", ""],
        "inner": inner,
        "inners": [inner, {"a": 1, "text": "", "b": 2.0}],
        "more": [],
        "most": [inner],
        "last": 7,
    }
    codec = types.codec("lab/msg/All")
    assert codec.unpack(codec.pack(message)) == message
    assert codec.unpack(codec.pack(message, b"12345678"), 12) == message
    assert codec.pack(codec.unpack(codec.pack({}))) == codec.pack({})


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ({"point": {"x": "far"}}, "the field 'point.x' takes a number (float64), not 'far'"),
        ({"point": {"w": 1}}, "geometry_msgs/msg/Point has no field 'w' (point); it has x, y, z"),
        ({"pont": {}}, "geometry_msgs/msg/PointStamped has no field 'pont'; it has header, point"),
        ({"point": 3}, "the field 'point' takes the fields of a geometry_msgs/msg/Point, not 3"),
        ({"point": None}, "the field 'point' takes the fields of a geometry_msgs/msg/Point, not None"),
        ({"header": {"frame_id": b"x"}}, "the field 'header.frame_id' takes a text, not b'x'"),
        ({"header": {"frame_id": "a\0b"}}, "the field 'header.frame_id' takes a text without zero characters"),
        ({"header": {"frame_id": "\ud800"}}, "the field 'header.frame_id' takes a text that UTF-8 can hold"),
        ({"header": {"stamp": {"sec": 1.5}}}, "the field 'header.stamp.sec' takes a whole number (int32), not 1.5"),
        ({"header": {"stamp": {"nanosec": -1}}}, "the field 'header.stamp.nanosec' takes a whole number (uint32)"),
    ],
)
def test_a_message_that_does_not_fit_is_refused_by_its_field(
    types: InterfaceCatalog, message: dict[str, Any], said: str
) -> None:
    codec = types.codec("geometry_msgs/msg/PointStamped")
    with pytest.raises(PortError) as refused:
        codec.pack(message)
    assert str(refused.value).startswith(said)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("yes", "no", "the field 'yes' takes true or false, not 'no'"),
        ("yes", 2, "the field 'yes' takes true or false, not 2"),
        ("three", [True], "the field 'three' takes exactly 3 values, not 1"),
        ("three", ["a", True, True], "the field 'three[0]' takes true or false, not 'a'"),
        ("few", [1, 2, 3], "the field 'few' takes at most 2 values, not 3"),
        ("few", "12", "the field 'few' takes a list (int16[<=2]), not '12'"),
        ("few", 3, "the field 'few' takes a list (int16[<=2]), not 3"),
        ("octets", [256], "the field 'octets[0]' takes a whole number (uint8), not 256"),
        ("octets", 5, "the field 'octets' takes a list (uint8[]), not 5"),
        ("short", ["four", "fünf"], "the field 'short[1]' takes a text of at most 4 bytes, not 5"),
        ("short", "four", "the field 'short' takes a list (string<=4[]), not 'four'"),
        ("single", 1e40, "the field 'single' takes a number (float32), not 1e+40"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(tmp_path: Path, field: str, value: Any, said: str) -> None:
    text = "bool yes\nbool[3] three\nint16[<=2] few\nuint8[] octets\nstring<=4[] short\nfloat32 single\n"
    codec = share(tmp_path, A=text).codec("lab/msg/A")
    with pytest.raises(PortError) as refused:
        codec.pack({field: value})
    assert str(refused.value) == said


def test_bytes_that_are_no_such_message_are_refused(types: InterfaceCatalog) -> None:
    codec = types.codec("std_msgs/msg/Float64MultiArray")
    whole = codec.pack({"data": [1.0, 2.0], "layout": {"dim": [{"label": "x"}]}})
    for size in range(4, len(whole) - 7):
        with pytest.raises(PortError):
            codec.unpack(whole[:size])
    huge = bytearray(codec.pack({}))
    huge[-4:] = b"\xff\xff\xff\x7f"
    with pytest.raises(PortError, match="are no std_msgs/msg/Float64MultiArray"):
        codec.unpack(bytes(huge))
    with pytest.raises(PortError, match="encoding that is not understood"):
        codec.unpack(b"\x00\x07" + whole[2:])


def test_whatever_bytes_come_they_are_a_message_or_are_refused_at_once(types: InterfaceCatalog) -> None:
    chance = random.Random(7)
    for name in ("diagnostic_msgs/msg/DiagnosticArray", "sensor_msgs/msg/JointState", "std_msgs/msg/ByteMultiArray"):
        codec, refused = types.codec(name), 0
        for _ in range(500):
            data = codec.pack({})[:4] + chance.randbytes(chance.randrange(120))
            try:
                codec.pack(codec.unpack(data))
            except PortError:
                refused += 1
        assert refused > 0


def test_a_sequence_of_messages_without_fields_ends_with_the_bytes(tmp_path: Path) -> None:
    codec = share(tmp_path, Nothing="", A="Nothing[] many\n").codec("lab/msg/A")
    assert codec.unpack(codec.pack({"many": [{}, {}]})) == {"many": [{}, {}]}
    with pytest.raises(PortError, match="longer than the message"):
        codec.unpack(codec.pack({})[:4] + b"\xff\xff\xff\xff")


def test_a_text_that_is_no_utf8_still_arrives(types: InterfaceCatalog) -> None:
    codec = types.codec("std_msgs/msg/String")
    assert codec.unpack(codec.pack({"data": "ab"}).replace(b"ab", b"\xe4b")) == {"data": "\ufffdb"}


# --- what is derived -----------------------------------------------------------------------------------------------


def test_what_an_action_implies(types: InterfaceCatalog) -> None:
    parts = action_types("rise_interfaces/action/Speech")
    assert types.fields(f"{parts['send_goal']}_Request") == {
        "goal_id": "unique_identifier_msgs/msg/UUID",
        "goal": "rise_interfaces/action/Speech_Goal",
    }
    assert types.fields(f"{parts['send_goal']}_Response") == {
        "accepted": "bool",
        "stamp": "builtin_interfaces/msg/Time",
    }
    assert types.fields(f"{parts['get_result']}_Response") == {
        "status": "int8",
        "result": "rise_interfaces/action/Speech_Result",
    }
    assert list(types.fields(parts["feedback"])) == ["goal_id", "feedback"]
    assert list(types.fields(f"{CANCEL_TYPE}_Response")) == ["return_code", "goals_canceling"]
    assert types.fields(STATUS_TYPE) == {"status_list": "action_msgs/msg/GoalStatus[]"}


def test_a_whole_service_or_action_has_a_hash_but_no_messages(types: InterfaceCatalog) -> None:
    for name, parts in (
        ("std_srvs/srv/SetBool", "std_srvs/srv/SetBool_Request, and the same with _Response"),
        (
            "rise_interfaces/action/Speech",
            "rise_interfaces/action/Speech_Goal, and the same with _Result and _Feedback",
        ),
    ):
        assert types.type_hash(name) == HASHES[name]
        with pytest.raises(PortError) as refused:
            types.fields(name)
        assert str(refused.value) == f"{name} is not a message; its messages are {parts}"


def test_a_message_without_fields(types: InterfaceCatalog) -> None:
    assert types.fields("std_srvs/srv/Empty_Request") == {}
    codec = types.codec("std_srvs/srv/Empty_Request")
    assert codec.unpack(codec.pack({})) == {}


# --- where definitions come from -----------------------------------------------------------------------------------


def test_a_users_folder_counts_first_then_a_sourced_workspace(tmp_path: Path) -> None:
    for number, folder in enumerate(("own", "sourced/share")):
        path = tmp_path / folder / "std_msgs" / "msg" / "String.msg"
        path.parent.mkdir(parents=True)
        path.write_text(f"string data\nint32 number{number}\n", encoding="utf-8")
    sourced = {"AMENT_PREFIX_PATH": f"{tmp_path}/nothing:{tmp_path}/sourced"}
    assert list(InterfaceCatalog([tmp_path / "own"], sourced).fields("std_msgs/msg/String")) == ["data", "number0"]
    assert list(InterfaceCatalog([], sourced).fields("std_msgs/msg/String")) == ["data", "number1"]
    assert list(InterfaceCatalog([], {}).fields("std_msgs/msg/String")) == ["data"]


def test_the_folder_of_one_package_will_do(tmp_path: Path) -> None:
    share(tmp_path, Wave_action="string hand\n---\n---\n")
    types = InterfaceCatalog([tmp_path / "lab"], environment={})
    assert types.fields("lab/action/Wave_Goal") == {"hand": "string"}


def test_a_folder_that_does_not_exist_is_said(tmp_path: Path) -> None:
    with pytest.raises(PortError, match=r"folder of ROS definitions .* does not exist"):
        InterfaceCatalog([tmp_path / "nowhere"], environment={})


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("String", "'String' is not the name of a ROS type; one looks like std_msgs/msg/String"),
        ("std_msgs/String", "'std_msgs/String' is not the name of a ROS type"),
        ("std_msgs/msg/Sting", "the type std_msgs/msg/Sting is not known: there is no msg/Sting.msg in the standard"),
        ("std_msgs/msg/Sting", "Did you mean std_msgs/msg/String?"),
        ("rise_interfaces/action/Speach_SendGoal_Request", "there is no action/Speach.action in"),
        ("rise_interfaces/action/Speach_SendGoal_Request", "Did you mean rise_interfaces/action/Speech?"),
        ("geometri_msgs/msg/Point", "no definitions of the package geometri_msgs (did you mean geometry_msgs?)"),
        ("pepper_msgs/action/Wave", "Source the ROS workspace that has it, or name the folder of its definitions"),
    ],
)
def test_a_type_that_is_not_known(types: InterfaceCatalog, name: str, said: str) -> None:
    with pytest.raises(PortError) as refused:
        types.fields(name)
    assert said in str(refused.value)


def test_a_nested_type_that_is_not_known_is_named_with_its_field(tmp_path: Path) -> None:
    types = share(tmp_path, A="other_msgs/Thing thing\n", B="A a\n")
    with pytest.raises(PortError) as refused:
        types.fields("lab/msg/B")
    assert "B.msg: the field 'a'" not in str(refused.value)  # the file that names it, not the one that is asked for
    assert "A.msg: the field 'thing': the type other_msgs/msg/Thing is not known" in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("int32 a\nfloat65 b\n", "A.msg:2: there is no type 'float65'; a message's name begins with a capital letter"),
        ("int32\n", "A.msg:1: 'int32' is neither a field nor a constant"),
        ("int32 A\n", "A.msg:1: 'A' cannot be a field's name"),
        ("int32 a\n\nint8 a\n", "A.msg:3: the field 'a' is there twice"),
        ("int32[ a\n", "A.msg:1: 'int32[' is not a type"),
        ("int32<=3 a\n", "A.msg:1: only texts can have a largest length, not int32"),
        ("int8 LOW=many\n", "A.msg:1: 'many' is not a value for a constant of type int8"),
        ("time stamp\n", "A.msg:1: 'time' is of ROS 1; in ROS 2 it is builtin_interfaces/Time"),
        ("A again\n", "A.msg: lab/msg/A contains itself"),
    ],
)
def test_a_file_that_cannot_be_understood_is_named_with_the_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(PortError) as refused:
        share(tmp_path, A=text).fields("lab/msg/A")
    assert said in str(refused.value)


def test_parts_that_are_missing_are_counted(tmp_path: Path) -> None:
    types = share(tmp_path, Wave_action="string hand\n---\n", Ask_srv="string question\n")
    with pytest.raises(PortError, match="an action has 3 parts with --- between them; here are 2"):
        types.fields("lab/action/Wave_Goal")
    with pytest.raises(PortError, match="a service has 2 parts with --- between them; here are 1"):
        types.fields("lab/srv/Ask_Request")


def test_constants_are_no_fields(tmp_path: Path) -> None:
    types = share(
        tmp_path,
        A='int8 HEX=0x1f\nbool YES=true\nfloat32 HALF=.5\nstring WORD="a = b"\nstring BARE=two words\nint8 field 3\n',
    )
    assert types.fields("lab/msg/A") == {"field": "int8"}


def test_texts_of_two_bytes_a_letter_have_a_hash_but_no_bytes(tmp_path: Path) -> None:
    path = tmp_path / "example_interfaces" / "msg" / "WString.msg"
    path.parent.mkdir(parents=True)
    path.write_text("wstring data\n", encoding="utf-8")
    types = InterfaceCatalog([tmp_path], environment={})
    official = "RIHS01_32033e06d9dfe5468c5d6e1dc8b7a23c8910bad071cfd4e151a951d580e68dd8"
    assert types.type_hash("example_interfaces/msg/WString") == official
    with pytest.raises(PortError, match=r"the field data of .*WString is a wstring .*`dds` cannot carry"):
        types.codec("example_interfaces/msg/WString")


def test_a_folder_of_definitions_is_no_installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a checkout, where `adapters/rise_interfaces` can be imported although nobody has built it."""
    share(tmp_path, Say_action="string text\n---\n---\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(PortError, match="the ROS package lab is not installed, or not sourced"):
        InstalledTypes().find_message("lab/action/Say_Goal")
