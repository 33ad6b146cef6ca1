"""Language tags by BCP 47: `en`, `de-AT`, `zh-Hant-TW` (https://www.rfc-editor.org/info/bcp47).

A first part of two letters must be in ISO 639-1. All other parts are only checked for their form.
"""

from __future__ import annotations

import re

from rise_engine.base.nearest_name import did_you_mean

_TAG = re.compile(
    r"""[a-z]{2,3}(?:-[a-z]{3}){0,3}      # language, extended language
        (?:-[a-z]{4})?                    # script
        (?:-(?:[a-z]{2}|\d{3}))?          # region
        (?:-(?:[a-z\d]{5,8}|\d[a-z\d]{3}))*
        (?:-[a-wyz\d](?:-[a-z\d]{2,8})+)*
        (?:-x(?:-[a-z\d]{1,8})+)?""",
    re.VERBOSE | re.ASCII,
)
_ISO_639_1 = """
    aa ab ae af ak am an ar as av ay az ba be bg bh bi bm bn bo br bs ca ce ch co cr cs cu cv cy da de dv dz ee el en eo
    es et eu fa ff fi fj fo fr fy ga gd gl gn gu gv ha he hi ho hr ht hu hy hz ia id ie ig ii ik io is it iu ja jv ka kg
    ki kj kk kl km kn ko kr ks ku kv kw ky la lb lg li ln lo lt lu lv mg mh mi mk ml mn mr ms mt my na nb nd ne ng nl nn
    no nr nv ny oc oj om or os pa pi pl ps pt qu rm rn ro ru rw sa sc sd se sg sh si sk sl sm sn so sq sr ss st su sv sw
    ta te tg th ti tk tl tn to tr ts tt tw ty ug uk ur uz ve vi vo wa wo xh yi yo za zh zu
"""
_LANGUAGES = frozenset(_ISO_639_1.split())
_WRITTEN_INSTEAD = """
    english en  british en-GB  american en-US  gb en-GB  us en-US  german de  deutsch de  at de-AT
    french fr  français fr  francais fr  spanish es  español es  espanol es  italian it  italiano it  portuguese pt
    dutch nl  nederlands nl  polish pl  danish da  dk da  swedish sv  norwegian nb  finnish fi  czech cs  cz cs
    japanese ja  jp ja  chinese zh  cn zh  korean ko  greek el  gr el  turkish tr  russian ru  arabic ar  hebrew he
    hindi hi
"""
_INTENDED_TAGS = dict(zip(_WRITTEN_INSTEAD.split()[::2], _WRITTEN_INSTEAD.split()[1::2], strict=True))
"""Usual spellings, and the intended tags."""


def language_problem(tag: str) -> str:
    """Return the error of a language tag, as a sentence; empty: it is valid.

    >>> language_problem("de-AT"), language_problem("german")
    ('', '`german` is not a language tag; write de')
    """
    small = tag.lower()
    meant = _INTENDED_TAGS.get(small, "")
    if not meant and "_" in small and not language_problem(tag.replace("_", "-")):
        meant = tag.replace("_", "-")
    if meant:
        return f"`{tag}` is not a language tag; write {meant}"
    if _TAG.fullmatch(small) is None:
        return f"`{tag[:60]}` is not a language tag; write it as in en, de or pt-BR (BCP 47)"
    first = small.partition("-")[0]
    if len(first) == 2 and first not in _LANGUAGES:
        return f"there is no language `{first}`{did_you_mean(first, sorted(_LANGUAGES))}"
    return ""


def meant_language(text: str) -> str:
    """The tag of the language that a text names: `de` for `german`; empty: none, or a tag of three letters.

    >>> meant_language("German"), meant_language("de-AT"), meant_language("old")
    ('de', 'de-AT', '')
    """
    meant = _INTENDED_TAGS.get(text.lower(), "") or text
    return meant if len(meant.partition("-")[0]) == 2 and not language_problem(meant) else ""


def language_fits(tag: str, text: str) -> bool:
    """Whether the language `tag` includes the language `text`: `en` includes `en-GB`.

    >>> language_fits("en", "en-GB"), language_fits("en-GB", "en"), language_fits("en", "")
    (True, False, False)
    """
    tag, text = tag.lower(), text.lower()
    return text == tag or text.startswith(f"{tag}-")
