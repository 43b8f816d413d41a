"""All peers, in the order of the tables; each comes after the one that it starts from."""

from __future__ import annotations

from truing.studies.real.peers.arx import ARX
from truing.studies.real.peers.ladder import RUNGS, ladder
from truing.studies.real.peers.n4sid import N4SID
from truing.studies.real.peers.peer import Peer
from truing.studies.real.peers.sindy import SINDY
from truing.studies.real.peers.wpilib_sysid import SYSID

PEERS: tuple[Peer, ...] = (*ladder(), SYSID, ARX, N4SID, SINDY)
LADDER: tuple[str, ...] = tuple(rung.name for rung in RUNGS)
