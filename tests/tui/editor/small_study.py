"""A small study whose rule has one of everything: what the tests of the editor's rules read."""

from __future__ import annotations

from collections.abc import Mapping

from rise_engine.author.edit.outline import Outline
from rise_engine.author.edit.read_outline import read_outline
from rise_engine.scenario.loader import load
from rise_tui.editor.model.study_names import StudyNames, study_names

ACTS = b"""<Dialogs>
  <Dialog name="R_Hello"><Speech><actionID>1</actionID><message>Hello.</message></Speech></Dialog>
  <Dialog name="R_Bye"><Speech><actionID>1</actionID><message>Bye.</message></Speech></Dialog>
</Dialogs>
"""
RULES = b"""<InteractionRules>
<InteractionRule name="Course" initial="Start" priority="1">
  <State id="Start">
    <onEntry>
      <function assignValue="step = 0"/>
      <if cond="step &lt; 4">
        <function startCommunicationRobotAct="R_Hello"/>
        <elseif cond="happy">
          <function raiseEventTopic="/cheer" keep="5s"/>
        </elseif>
        <else/>
      </if>
      <oneOf>
        <function startCommunicationRobotAct="R_Hello"/>
        <function startInteractionRule="Other" state="Two" enter="no"/>
      </oneOf>
    </onEntry>
    <transition ended="R_Hello" outcome="failed | stopped" target="Wait"/>
    <transition eventTopic="/skip" cond="step &lt; 4 and not happy" target="End">
      <function stopCommunicationRobotAct="R_Hello"/>
    </transition>
    <transition after="{pause_ms}ms" while="happy" target="Start"/>
    <transition cond="true"/>
  </State>
  <use template="Wait" id="Wait" then="End"/>
  <State id="End"/>
  <transitions in="Wait"><transition eventTopic="/stop_it" target="End"/></transitions>
</InteractionRule>
<InteractionRule name="Other" initial="One">
  <State id="One"><transition eventTopic="/next" target="Two"/></State>
  <State id="Two"/>
</InteractionRule>
<Template name="Wait">
  <parameter name="id"/><parameter name="then"/><parameter name="pause" default="2s"/>
  <State id="${id}"><transition after="${pause}" target="${then}"/></State>
</Template>
</InteractionRules>
"""
SETTINGS = b"""[keys]
n = { event = "/next", label = "next" }
h = { act = "R_Hello" }
m = { set = "mood = 1" }
"""
MEMORY = b'{"step": 0, "happy": false, "pause_ms": 600, "items": [1, 2]}'
FILES = {
    "acts/acts.xml": ACTS, "rules/course.xml": RULES, "scenario.toml": SETTINGS, "memory.json": MEMORY,
    "tables/words.csv": b"word\na\nb\n",
}  # fmt: skip


def outline_of(files: Mapping[str, bytes]) -> Outline:
    """What is written in files that lie nowhere."""
    return read_outline(load("/nowhere", held=files).parts)


def small_study(files: Mapping[str, bytes] = FILES) -> StudyNames:
    """Its names, as they are when it has been read."""
    return study_names(outline_of(files), load("/nowhere", held=files).draft, files)
