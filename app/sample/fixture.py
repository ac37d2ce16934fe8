"""Fixture: an invented match with its clubs, its folder and its look."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np

from app.sample.look import Look, make_look

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
class Fixture:
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
    look: Look

    @property
    def name(self) -> str:
        """Last part of the folder."""
        date = self.kick_off.strftime("%Y-%m-%d - %H-%M")
        return f"{date} {self.home} {self.score[0]} - {self.score[1]} {self.away}"

    @property
    def folder(self) -> str:
        """Folder of the match below the root of the dataset."""
        return f"{self.league}/{self.season}/{self.name}"


def make_fixture(index: int, seed: int) -> Fixture:
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
    return Fixture(
        index=index,
        league=LEAGUES[league],
        season=SEASON,
        kick_off=kick_off,
        home=home,
        away=away,
        score=(int(goals[0]), int(goals[1])),
        split=split_of(index),
        look=make_look(index, seed, evening=hour >= 18),
    )


def split_of(index: int) -> str:
    """Six of eight matches train, one valid, one test; four matches have all three."""
    return {2: "valid", 3: "test"}.get(index % 8, "train")


def group_counts(groups: int) -> list[int]:
    """How many groups each match holds: at least four matches, about 32 groups in large ones."""
    matches = max(min(4, groups), round(groups / 31.91))
    edges = [groups * i // matches for i in range(matches + 1)] if matches else [0]
    return [end - start for start, end in pairwise(edges)]
