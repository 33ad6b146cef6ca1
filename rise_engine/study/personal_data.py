"""What looks like personal data where only pseudonyms may stand.

A study's folder is copied, archived and shared; who P07 is stands in a list that lies elsewhere. What is found here is
by the usual words for it in some languages, and by the form of mail addresses: it is a net, no proof.
"""

from __future__ import annotations

import re
from unicodedata import combining, normalize

WHY = (
    "this folder knows people by their pseudonyms only, because it is copied, archived and shared; who they are stands "
    "in a list of yours in another place"
)

_WORDS: dict[str, str] = {
    "a name": "name names nombre nombres apellido apellidos nom noms prenom nome cognome sobrenome naam namn imie "
    "nazwisko initials initialen initiales",
    "a mail address": "mail mails email emails correo courriel epost emailadresse mailadresse",
    "a phone number": "phone phonenumber telephone telephon telefon telefonnummer telefonnr tel fon "
    "mobilnummer handy handynummer handynr cellphone fax whatsapp movil telefono",
    "a date of birth": "birth birthday birthdate dateofbirth dob geburtstag geburtsdatum geburt geb gebdat gebdatum "
    "naissance nacimiento nascita nascimento geboortedatum",
    "an address": "address addresses adresse adressen anschrift street strasse hausnummer hausnr plz postleitzahl "
    "postcode postalcode zip zipcode wohnort direccion indirizzo adres adress domicile",
    "a number of an identity card": "ssn passport ausweis ausweisnummer personalausweis matrikel matrikelnummer "
    "matrikelnr matriculation studentid steuerid steuernummer iban kontonummer dni nif",
}
_KIND_OF_WORD = {word: kind for kind, words in _WORDS.items() for word in words.split()}
_ENDINGS = {
    "name": "a name",
    "mail": "a mail address",
    "phone": "a phone number",
    "telefon": "a phone number",
    "birth": "a date of birth",
    "birthday": "a date of birth",
    "adresse": "an address",
    "address": "an address",
    "strasse": "an address",
}
"""What the last part of a word tells: Vorname, surname, Privatadresse."""
_MAIL = re.compile(r"[^\s@<>,;:]+@[^\s@<>,;:]+\.[^\s@<>,;:.]{2,}")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def personal_column(column: str) -> str:
    """What a column of that name seems to hold of a person, or empty.

    >>> personal_column("Nachname"), personal_column("E-Mail"), personal_column("handedness")
    ('a name', 'a mail address', '')
    """
    words = re.findall(r"[a-z0-9]+", _HUMP.sub(" ", _plain(column)).casefold())
    joined = "".join(words)
    for word in [joined, *words]:
        if kind := _KIND_OF_WORD.get(word):
            return kind
        if ending := next((ending for ending in _ENDINGS if word.endswith(ending)), ""):
            return _ENDINGS[ending]
    return ""


def mail_address_in(text: str) -> str:
    """A part of the text that looks like a mail address, or empty.

    >>> mail_address_in("ask maria.m@uni.example first")
    'maria.m@uni.example'
    """
    found = _MAIL.search(text)
    return found.group() if found is not None else ""


def _plain(text: str) -> str:
    """Without accents; `ß` is `ss`, and umlauts lose their dots."""
    return "".join(each for each in normalize("NFD", text.replace("ß", "ss")) if not combining(each))
