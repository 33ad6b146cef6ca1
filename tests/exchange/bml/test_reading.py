"""BML as acts: what maps exactly in time does, what does not is refused with the sentence that says why."""

from __future__ import annotations

import pytest

from tests.exchange.bml.samples import block, read, read_text

S1 = '<speech id="s1"><text>Hello.</text></speech>'
S2 = '<speech id="s2"><text>Bye.</text></speech>'
NOD = '<head id="h" lexeme="NOD" {}/>'


def nod(attributes: str) -> str:
    return NOD.format(attributes)


@pytest.mark.parametrize(
    ("start", "waits"),
    [
        ("", {"h": ()}),
        ('start="0"', {"h": ()}),
        ('start="s1:end"', {"h": ("s1",)}),
        ('start="b:s1:end"', {"h": ("s1",)}),
        ('start="s1:end + 0.5"', {"wait_1": ("s1",), "h": ("wait_1",)}),
        ('start="2.0"', {"wait_1": (), "h": ("wait_1",)}),
        ('start="s1:start"', {"h": ()}),
        ('start="s1:start+1.5"', {"wait_1": (), "h": ("wait_1",)}),
    ],
)
def test_times_that_an_act_keeps(start: str, waits: dict[str, tuple[str, ...]]) -> None:
    found = read(S1 + nod(start))
    assert found.waits == {"s1": ()} | waits
    assert not found.errors and not found.losses


def test_a_start_is_the_start_of_what_it_waits_for() -> None:
    found = read(f'{S1}<head id="h" lexeme="NOD" start="s1:end+1"/><wait id="w" start="h:start-0.25" duration="1"/>')
    assert found.waits == {"s1": (), "wait_1": ("s1",), "h": ("wait_1",), "wait_2": ("s1",), "w": ("wait_2",)}
    assert found.does["wait_1"]["duration"] == "1000" and found.does["wait_2"]["duration"] == "750"


def test_equal_waits_are_one() -> None:
    found = read(S1 + nod('start="s1:end+1"') + '<wait id="w" start="s1:end + 1.0" duration="2"/>')
    assert found.waits == {"s1": (), "wait_1": ("s1",), "h": ("wait_1",), "w": ("wait_1",)}


def test_several_that_must_be_over() -> None:
    after = "".join(f'<after ref="{id}:end"><sync ref="h:start"/></after>' for id in ("s2", "s1"))
    found = read(S1 + S2 + nod("") + f"<constraint>{after}</constraint>")
    assert found.waits["h"] == ("s2", "s1")
    later = read(S1 + S2 + nod("") + f'<wait id="w" start="h:start+1" duration="1"/><constraint>{after}</constraint>')
    assert later.waits["w"] == ("wait_1",) and later.waits["wait_1"] == ("s2", "s1")


def test_synchronize_of_starts_and_ends() -> None:
    for inside in (
        '<synchronize ref="s1:end"><sync ref="h:start"/></synchronize>',
        '<synchronize ref="h:start"><sync ref="s1:end"/></synchronize>',
        '<synchronize><sync ref="s1:end"/><sync ref="h:start"/></synchronize>',
    ):
        assert read(S1 + nod("") + f"<constraint>{inside}</constraint>").waits["h"] == ("s1",)


@pytest.mark.parametrize(
    ("inside", "place", "sentence"),
    [
        (nod('stroke="1"'), "2:27", "`stroke` cannot be kept: an act's action has a start and an end"),
        (nod('start="s1:end-0.5"'), "2:34", "0.5 s before the end of `s1` cannot be kept"),
        (nod('start="s1:ready"'), "2:34", "`s1:ready` is a point within a behaviour"),
        (nod('start="s1:ennd"'), "2:34", "`s1` has no sync point `ennd`; did you mean `end`?"),
        (nod('start="s3:end"'), "2:34", "there is no behaviour `s3` in this block; known: `h`, `s1`"),
        (nod('start="other:s1:end"'), "2:34", "`other` is another block"),
        (nod('start="s1:stroke:2"'), "2:34", "`s1:stroke:2` is a point within `s1`"),
        (nod('start="soon"'), "2:34", "`soon` is not a time of BML 1.0"),
        (nod('start="h:end"'), "2:34", "these behaviours wait for each other: h -> h"),
        (nod('end="2"'), "2:32", "`end` cannot be 2: an action ends when it has done what it does; with a `start`"),
        (nod('start="0" end="s1:end"'), "2:42", "`end` cannot be s1:end"),
        (nod('start="2" end="1"'), "2:42", "`h` would end before it has begun"),
        ('<gaze id="g" target="visitor" start="0" end="2"/>', "2:46", "`end` cannot be kept for `<gaze>`"),
        ('<wait id="w" max-wait="2"/>', "2:14", "`max-wait` cannot be kept"),
        ('<head id="h" lexeme="NOD" repetition="3" start="0" end="1"/>', "2:57", "1 s cannot be shared out"),
    ],
)
def test_times_that_an_act_cannot_keep(inside: str, place: str, sentence: str) -> None:
    found = read(f"{inside}\n{S1}")
    assert found.read is None
    assert len(found.errors) == 1
    assert found.errors[0].startswith(f"b.xml:{place}: error bml-time: ") and sentence in found.errors[0]


@pytest.mark.parametrize(
    ("constraint", "sentence"),
    [
        ('<before ref="s1:end"><sync ref="h:start"/></before>', "it only waits for what has ended"),
        (
            '<after ref="s1:end"><sync ref="h:stroke"/></after>',
            "only the start of a behaviour can wait, not `h:stroke`",
        ),
        ('<after ref="s1:mark"><sync ref="h:start"/></after>', "`mark` is a mark in the words of `s1`"),
        ('<after ref="s1:end-1"><sync ref="h:start"/></after>', "a time before an end cannot be kept"),
        ('<synchronize ref="s1:end"><sync ref="h:end"/></synchronize>', "only the start of a behaviour can wait"),
        ('<synchronize ref="s1:end"><sync ref="x:start"/></synchronize>', "there is no behaviour `x` in this block"),
    ],
)
def test_constraints_that_an_act_cannot_keep(constraint: str, sentence: str) -> None:
    speech = '<speech id="s1"><text>One <sync id="mark"/> two.</text></speech>'
    found = read(f"{speech}{nod('')}<constraint>{constraint}</constraint>")
    assert found.read is None and len(found.errors) == 1 and sentence in found.errors[0]


def test_a_long_block_is_read_and_a_long_circle_is_told() -> None:
    waits = [
        f'<wait id="w{n}" start="w{n + 1}:{point}" duration="1"/>'
        for n in range(2000)
        for point in ["start", "end"][n % 2 :][:1]
    ]
    found = read("".join(waits) + '<wait id="w2000" duration="1"/>')
    assert len(found.act.actions) == 2000 + 1
    circle = read("".join(waits) + '<wait id="w2000" start="w0:end" duration="1"/>')
    assert len(circle.errors) == 1 and "wait for each other: w0 -> w1 -> " in circle.errors[0]


def test_an_exact_start_and_a_later_one_are_not_held_both() -> None:
    after = '<constraint><after ref="s2:end"><sync ref="h:start"/></after></constraint>'
    found = read(S1 + S2 + nod('start="s1:end"') + after)
    assert found.read is None and "an act cannot hold both" in found.errors[0]


@pytest.mark.parametrize(
    ("inside", "does"),
    [
        ("<text>Say {this}.</text>", {"type": "Speech", "message": "Say {{this}}."}),
        (
            '<head id="h" lexeme="SHAKE" repetition="2"/>',
            {"type": "Animation", "value": "head_shake", "repetitions": "2"},
        ),
        (
            '<head id="h" lexeme="NOD" repetition="2" start="1" end="2.5"/>',
            {"type": "Animation", "value": "head_nod", "repetitions": "2", "duration": "750"},
        ),
        ('<gesture id="h" lexeme="BEAT"/>', {"type": "Animation", "value": "engagement_left"}),
        ('<gesture id="h" lexeme="Eyebrows_Raise"/>', {"type": "Animation", "value": "eyebrows_raise"}),
        (
            '<faceLexeme id="h" lexeme="smile" end="h:start+2"/>',
            {"type": "Emotion", "value": "happy", "duration": "2000"},
        ),
        ('<faceLexeme id="h" lexeme="SAD"/>', {"type": "Emotion", "value": "sad"}),
        ('<faceShift id="h"><lexeme lexeme="angry"/></faceShift>', {"type": "Emotion", "value": "angry"}),
        ('<face id="h"><lexeme lexeme="RAISE_BROWS"/></face>', {"type": "Animation", "value": "eyebrows_raise"}),
        ('<postureShift id="h"><stance type="SITTING"/></postureShift>', {"type": "Animation", "value": "idle"}),
        (
            '<gazeShift id="h" target="visitor" start="1" end="1.5"/>',
            {"type": "LookAt", "pointx": "1.5", "pointy": "0", "pointz": "1.2", "duration": "500"},
        ),
        (
            '<gazeShift id="h" target="door"/>',
            {"type": "LookAt", "pointx": "-1", "pointy": "2", "pointz": "0", "frame": "map"},
        ),
        ('<wait id="h" duration="0.25"/>', {"type": "Wait", "duration": "250"}),
        ('<wait id="h" start="1" end="3"/>', {"type": "Wait", "duration": "2000"}),
    ],
)
def test_what_behaviours_do(inside: str, does: dict[str, str]) -> None:
    found = read(f'<speech id="h">{inside}</speech>' if inside.startswith("<text>") else inside)
    assert found.does["h"] == does
    assert not found.losses


def test_ssml_of_a_description_is_said() -> None:
    marked = '<speak xmlns="http://www.w3.org/2001/10/synthesis">Well, <break time="1s"/> hello.</speak>'
    description = f'<description priority="1" type="application/ssml+xml">{marked}</description>'
    found = read(f'<speech id="s"><text>Well, hello.</text>{description}</speech>')
    assert found.does["s"]["message"] == marked and not found.losses


@pytest.mark.parametrize(
    ("inside", "place", "code", "sentence"),
    [
        ('<gesture id="g" lexeme="BEET"/>', "2:25", "bml-name", "`BEET` has no meaning here; did you mean `BEAT`?"),
        ('<gazeShift id="g" target="dooor"/>', "2:27", "bml-name", "`dooor` has no place here; did you mean `door`?"),
        ('<locomotion id="g" target="door"/>', "2:1", "bml-no-action", "no action moves the robot from its place"),
        ('<gezture id="g"/>', "2:1", "bml-no-action", "not a behaviour of BML 1.0; did you mean `gesture`?"),
        ('<x:torso xmlns:x="urn:x" id="t"/>', "2:1", "bml-no-action", "its meaning is unknown here"),
        ('<head id="g" lexeme="NOD" strat="2"/>', "2:27", "bml-form", "no attribute `strat`; did you mean `start`?"),
        ('<head id="g"/>', "2:1", "bml-form", "`<head>` needs the attribute `lexeme`"),
        ('<speech id="g"/>', "2:1", "bml-form", "nothing is said here"),
        ('<speech id="g">Hello</speech>', "2:1", "bml-form", "nothing is said here"),
        ('<face id="g"/>', "2:1", "bml-no-action", "`<face>` with no `<lexeme>`"),
        ('<wait id="g"/>', "2:1", "bml-form", "`<wait>` needs its `duration`"),
        ('<wait id="a b" duration="1"/>', "2:11", "bml-form", "`a b` cannot be an actionID"),
    ],
)
def test_what_is_no_bml_or_no_action(inside: str, place: str, code: str, sentence: str) -> None:
    found = read(inside)
    assert found.read is None and len(found.errors) == 1
    assert found.errors[0].startswith(f"b.xml:{place}: error {code}: ") and sentence in found.errors[0]


def test_all_findings_are_told_at_once() -> None:
    found = read('<head id="g" lexeme="NOT"/>\n<head id="g" lexeme="NOD"/>\n<head id="i" lexeme="NOD" ready="1"/>')
    assert [each.split(": ")[0] for each in found.errors] == ["b.xml:2:22", "b.xml:3:11", "b.xml:4:27"]


def test_losses_are_named_with_their_place() -> None:
    found = read(
        '<speech id="s"><text>One <sync id="m"/> two.</text></speech>\n'
        '<head id="h" lexeme="NOD" amount="0.5"><description priority="2" type="x">y</description></head>\n'
        '<gaze id="z" target="visitor" influence="EYES"/>',
        'id="b" characterId="Sam" composition="REPLACE"',
    )
    assert found.does["s"]["message"] == "One two."
    told = [each.partition(": lost: ") for each in found.losses]
    first = '<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b" '
    expected = [
        (1, len(first + 'characterId="') + 1, "`Sam`: a scenario has one robot"),
        (1, len(first + 'characterId="Sam" composition="') + 1, "REPLACE: whether an act interrupts"),
        (2, 26, "the mark `m` in the words"),
        (3, 27, "`amount` of `<head>`"),
        (3, 40, "a description of the type `x`"),
        (4, 1, "`<gaze>` goes back after it"),
        (4, 31, "`influence` of `<gaze>`"),
    ]
    assert [place for place, _, _ in told] == [f"b.xml:{line}:{column}" for line, column, _ in expected]
    assert all(message.startswith(begin) for (_, _, message), (_, _, begin) in zip(told, expected, strict=True))


def test_what_is_required_ends_the_act_and_nothing_else_does() -> None:
    found = read(f"<required>{S1}</required>{S2}")
    assert [each.continue_on_failure for each in found.act.actions] == [False, True]


def test_composition_is_the_calling_type() -> None:
    for written, expected in (("", "None"), ("MERGE", "None"), ("APPEND", "Blocking"), ("append", "Blocking")):
        found = read(S1, f'id="b" composition="{written}"' if written else 'id="b"').read
        assert found is not None and found.calling_type == expected
    assert "did you mean `APPEND`?" in read(S1, 'id="b" composition="APEND"').errors[0]


def test_files_of_drafts_are_read_and_it_is_said() -> None:
    speech = (
        '<speech id="s" start="0.0" voice="openmary"><tm id="t0"/>One,<tm id="t1"/> two.<boundary id="x"/></speech>'
    )
    found = read_text(f"<bml>{speech}</bml>")
    assert found.act.name == "b" and found.does["s"]["message"] == "One, two."
    assert len(found.losses) == 5 and "is not in the namespace of BML 1.0" in found.losses[0]
    older = read_text(block(speech, "", "http://www.mindmakers.org/projects/BML"))
    assert older.does == found.does


def test_a_prefix_is_as_good_as_a_default_namespace() -> None:
    text = '<b:bml xmlns:b="http://www.bml-initiative.org/bml/bml-1.0" id="x"><b:head id="h" lexeme="NOD"/></b:bml>'
    assert read_text(text).does["h"]["value"] == "head_nod"
    assert "is not a block of BML 1.0" in read_text("<speech/>").errors[0]
    assert "is not a block of BML 1.0" in read_text('<bml xmlns="urn:x"/>').errors[0]
