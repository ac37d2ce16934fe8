"""Fixture: an invented match with its clubs, its folder and its look."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np

from app.geometry.arrays import FloatArray

Colour = tuple[float, float, float]
"""Blue, green, red from 0 to 255, in the light of a neutral day."""


@dataclass(frozen=True)
class Outfit:
    """What a team, a goalkeeper or a referee wears. ``pattern``: plain, stripes, halves."""

    shirt: Colour
    second: Colour
    shorts: Colour
    socks: Colour
    pattern: str = "plain"


@dataclass(frozen=True)
class Lamp:
    """A light: the horizontal shift of a shadow per metre of height, and how dark it is."""

    shift: tuple[float, float]
    darkness: float


@dataclass(frozen=True)
class Light:
    """Light of a match.

    Attributes:
        lamps: One for the sun, four for floodlights.
        softness: Width of a shadow's edge, metres.
        exposure: Gain per channel (blue, green, red).
        sky: Colour at the horizon and higher up.
        shade: Edge of the stand's shadow on the pitch as (y at x = 0, slope, darkness), or None.
    """

    lamps: tuple[Lamp, ...]
    softness: float
    exposure: Colour
    sky: tuple[Colour, Colour]
    shade: tuple[float, float, float] | None


@dataclass(frozen=True)
class Grass:
    """Grass of a match, mown in bands across the pitch or along it.

    ``band`` is the width of a band in metres, ``contrast`` the relative difference of two bands.
    """

    colour: Colour
    across: bool
    band: float
    contrast: float


@dataclass(frozen=True)
class Stands:
    """Stands of a match: rows of points (distance from the line, height), metres.

    Attributes:
        board_distance: Of the boards from the side line and from the goal line.
        profile: Corners of the cross section, shape (N, 2).
        kinds: What lies between two corners: 0 wall, 1 crowd, 2 roof.
        crowd: Colours of clothes, shape (N, 3).
        empty: Share of empty seats.
    """

    board_distance: tuple[float, float]
    profile: FloatArray
    kinds: tuple[int, ...]
    crowd: FloatArray
    seat: Colour
    wall: Colour
    empty: float


@dataclass(frozen=True)
class MatchAppearance:
    """Everything that the frames of one match have in common."""

    seed: int
    home: Outfit
    away: Outfit
    home_keeper: Outfit
    away_keeper: Outfit
    referee: Outfit
    light: Light
    grass: Grass
    stands: Stands


_NAVY, _BLACK, _WHITE = (66.0, 38.0, 26.0), (34.0, 32.0, 32.0), (236.0, 236.0, 234.0)
_RED, _SKY, _YELLOW = (42.0, 36.0, 196.0), (222.0, 176.0, 104.0), (52.0, 206.0, 238.0)
_BLUE, _GREEN, _ORANGE = (176.0, 76.0, 34.0), (78.0, 118.0, 22.0), (36.0, 118.0, 236.0)
_CLARET, _PURPLE, _TEAL = (58.0, 26.0, 116.0), (132.0, 48.0, 92.0), (156.0, 150.0, 32.0)
_GREY, _PINK, _LIME = (128.0, 122.0, 118.0), (176.0, 118.0, 232.0), (72.0, 226.0, 186.0)

# Pairs that no viewer mixes up, neither with each other nor with the grass.
_PAIRS = (
    (Outfit(_RED, _WHITE, _WHITE, _RED), Outfit(_NAVY, _SKY, _NAVY, _NAVY)),
    (Outfit(_SKY, _WHITE, _WHITE, _SKY, "halves"), Outfit(_CLARET, _SKY, _CLARET, _CLARET)),
    (Outfit(_WHITE, _NAVY, _NAVY, _WHITE), Outfit(_ORANGE, _BLACK, _BLACK, _ORANGE)),
    (Outfit(_BLUE, _RED, _BLUE, _BLUE, "stripes"), Outfit(_YELLOW, _BLUE, _YELLOW, _YELLOW)),
    (Outfit(_BLACK, _WHITE, _BLACK, _BLACK, "stripes"), Outfit(_RED, _YELLOW, _RED, _RED)),
    (Outfit(_CLARET, _SKY, _WHITE, _SKY, "halves"), Outfit(_WHITE, _PURPLE, _WHITE, _WHITE)),
    (Outfit(_PURPLE, _WHITE, _PURPLE, _WHITE), Outfit(_WHITE, _RED, _BLACK, _WHITE, "stripes")),
    (Outfit(_YELLOW, _BLACK, _BLACK, _YELLOW), Outfit(_BLUE, _WHITE, _WHITE, _BLUE)),
)
_KEEPERS = (_LIME, _PINK, _TEAL, _GREY, _ORANGE)
_REFEREES = (_YELLOW, _BLACK, _TEAL)


def make_look(index: int, seed: int, evening: bool) -> MatchAppearance:
    """The look of match ``index``: neighbours differ in kits, grass and light."""
    rng = np.random.default_rng([seed, index, 0x100C])
    home, away = _PAIRS[(index + seed) % len(_PAIRS)]
    keepers = [
        _choose_contrasting_colour(_KEEPERS, (home.shirt, away.shirt), skip) for skip in (0, 1)
    ]
    referee = _choose_contrasting_colour(_REFEREES, (home.shirt, away.shirt, *keepers), 0)
    return MatchAppearance(
        seed=int(rng.integers(1 << 31)),
        home=home,
        away=away,
        home_keeper=_make_plain_outfit(keepers[0]),
        away_keeper=_make_plain_outfit(keepers[1]),
        referee=Outfit(referee, _BLACK, _BLACK, _BLACK),
        light=_make_light(rng, index, evening),
        grass=_make_grass(rng, index),
        stands=_make_stands(rng, home, away),
    )


def _make_plain_outfit(colour: Colour) -> Outfit:
    return Outfit(colour, _BLACK, colour, colour)


def _choose_contrasting_colour(
    choices: tuple[Colour, ...], taken: tuple[Colour, ...], skip: int
) -> Colour:
    distances = [min(float(np.linalg.norm(np.subtract(c, t))) for t in taken) for c in choices]
    return choices[int(np.argsort(distances)[::-1][skip])]


def _make_light(rng: np.random.Generator, index: int, evening: bool) -> Light:
    if evening:
        length = rng.uniform(0.9, 1.3)
        shifts = [(sx * length, sy * length * 0.8) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)]
        return Light(
            lamps=tuple(Lamp(shift, darkness) for shift, darkness in zip(shifts, (0.3, 0.24, 0.26, 0.34), strict=True)),
            softness=0.10,
            exposure=(1.03, 1.0, 0.97),
            sky=((38.0, 26.0, 20.0), (22.0, 14.0, 10.0)),
            shade=None,
        )  # fmt: skip
    if index % 3 == 1:
        return Light(
            lamps=(Lamp((0.25, 0.15), 0.42),),
            softness=0.45,
            exposure=(1.0, 0.96, 0.93),
            sky=((222.0, 216.0, 208.0), (196.0, 188.0, 178.0)),
            shade=None,
        )
    angle, length = rng.uniform(0, 2 * np.pi), rng.uniform(0.8, 1.7)
    # The sun stands on the main side now and then: the stand then shades the near half.
    edge = (float(rng.uniform(2, 22)), float(rng.uniform(-0.12, 0.12)), 0.36)
    return Light(
        lamps=(Lamp((length * float(np.cos(angle)), -length * abs(float(np.sin(angle)))), 0.55),),
        softness=0.08,
        exposure=(0.94, 1.0, 1.05),
        sky=((238.0, 214.0, 182.0), (214.0, 158.0, 96.0)),
        shade=edge if index % 2 == 0 else None,
    )


def _make_grass(rng: np.random.Generator, index: int) -> Grass:
    # Between a yellowish spring pitch and a deep blue-green one.
    tone = rng.uniform(0, 1)
    colour = (48.0 + 20 * tone, 124.0 - 8 * tone, 92.0 - 24 * tone)
    return Grass(
        colour=colour,
        across=index % 4 != 3,
        band=float(rng.choice([5.25, 5.5, 5.83, 6.6])),
        contrast=float(rng.uniform(0.17, 0.30)),
    )


def _make_stands(rng: np.random.Generator, home: Outfit, away: Outfit) -> Stands:
    depth, rake = rng.uniform(15, 22), rng.uniform(0.50, 0.62)
    first_top = 1.6 + depth * rake
    second = rng.uniform(12, 18)
    second_top = first_top + 3.0 + second * (rake + 0.12)
    front = rng.uniform(6.5, 9.0)
    profile = np.array(
        [
            (front, 0.0),
            (front, 1.6),
            (front + depth, first_top),
            (front + depth, first_top + 3.0),
            (front + depth + second, second_top),
            (front + depth + second, second_top + 5.0),
            (front + depth - 4.0, second_top + 8.0),
        ]
    )
    neutral = [_NAVY, _BLACK, _GREY, _WHITE, _BLUE, _RED, (72.0, 92.0, 118.0), (96.0, 84.0, 74.0)]
    crowd = np.array([home.shirt] * 6 + [home.second] * 2 + [away.shirt] + neutral * 2)
    return Stands(
        board_distance=(float(rng.uniform(4.0, 5.2)), float(rng.uniform(4.4, 5.6))),
        profile=profile,
        kinds=(0, 1, 0, 1, 0, 2),
        crowd=crowd,
        seat=tuple(float(c) * 0.8 + 10 for c in home.shirt),  # type: ignore[arg-type]
        wall=(74.0, 70.0, 68.0),
        empty=float(rng.uniform(0.04, 0.25)),
    )


LEAGUES = ("borealia_first-league", "meridia_premier-division", "valdoria_serie-uno")
SEASON = "2025-2026"
# Invented places; a club plays in the league of its row.
CLUBS = (
    (
        "Brackenmoor", "Tarnholt", "Eastmere Vale", "Skarvik Harbour", "Ostermoor", "Quillgate",
        "Fennhollow", "Ravensund", "Lindmoor Forge", "Halvergate Rovers", "Grimsholt", "Corriewick",
    ),
    (
        "Marlowick", "Port Selwin", "Castlebrae Hythe", "Dunmarrow", "Whitlow Park", "Aldercombe",
        "Thornmere", "Kestrel Bay", "Northlea Mills", "Penhallow Town", "Ashgrove Wanderers", "Rookhurst",
    ),
    (
        "Montaluz", "Real Avrino", "Sant Orvell", "Campo Verrada", "Villa Serrano Norte", "Altamira Rey",
        "Porto Branquil", "Castelmar", "Deportivo Olvanda", "Rio Tresanto", "Vallorne", "Cala Merida Sur",
    ),
)  # fmt: skip
FIRST_KICK_OFF = datetime(2025, 8, 16)
KICK_OFFS = ((13, 30), (16, 0), (18, 30), (20, 45))


@dataclass(frozen=True)
class SampleMatch:
    """One match.

    Attributes:
        index: Number of the match in its sample, from 0.
        folder: ``<league>/<season>/<YYYY-MM-DD - HH-MM Home h - a Away>``.
        split: ``train``, ``valid`` or ``test``.
        look: Everything that its frames have in common.
    """

    index: int
    league: str
    season: str
    kick_off: datetime
    home: str
    away: str
    score: tuple[int, int]
    split: str
    look: MatchAppearance

    @property
    def name(self) -> str:
        """Last part of the folder."""
        date = self.kick_off.strftime("%Y-%m-%d - %H-%M")
        return f"{date} {self.home} {self.score[0]} - {self.score[1]} {self.away}"

    @property
    def folder(self) -> str:
        """Folder of the match below the root of the dataset."""
        return f"{self.league}/{self.season}/{self.name}"


def make_sample_match(index: int, seed: int) -> SampleMatch:
    """The match of that number: the same for the same seed, whatever else is made."""
    rng = np.random.default_rng([seed, index, 0xF1])
    league = index % len(LEAGUES)
    clubs = CLUBS[league]
    # A round of pairings per week: every folder name is different for 132 matches a league, and
    # the date makes it different for ever.
    week, pairing = divmod(index // len(LEAGUES), len(clubs) // 2)
    shift = week % (len(clubs) - 1) + 1
    home, away = clubs[(2 * pairing) % len(clubs)], clubs[(2 * pairing + shift) % len(clubs)]
    if week % 2:
        home, away = away, home
    hour, minute = KICK_OFFS[int(rng.integers(len(KICK_OFFS)))]
    kick_off = FIRST_KICK_OFF + timedelta(weeks=week, days=pairing % 2, hours=hour, minutes=minute)
    goals = rng.poisson((1.6, 1.2))
    return SampleMatch(
        index=index,
        league=LEAGUES[league],
        season=SEASON,
        kick_off=kick_off,
        home=home,
        away=away,
        score=(int(goals[0]), int(goals[1])),
        split=split_of_match(index),
        look=make_look(index, seed, evening=hour >= 18),
    )


def split_of_match(index: int) -> str:
    """Six of eight matches train, one valid, one test; four matches have all three."""
    return {2: "valid", 3: "test"}.get(index % 8, "train")


def group_counts_by_match(groups: int) -> list[int]:
    """How many groups each match holds: at least four matches, about 32 groups in large ones."""
    matches = max(min(4, groups), round(groups / 31.91))
    edges = [groups * i // matches for i in range(matches + 1)] if matches else [0]
    return [end - start for start, end in pairwise(edges)]
