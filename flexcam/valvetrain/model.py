"""Model of a valve train: mesh, members and parts, without matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

import numpy as np

from flexcam.core import IntArray
from flexcam.core.html import html_table
from flexcam.fem.assembly import Damping
from flexcam.fem.members import Member
from flexcam.fem.mesh import Mesh
from flexcam.fem.superelements import Superelement
from flexcam.valvetrain.parts import (
    Adjuster,
    Cam,
    CamContact,
    Contact,
    FilmBearing,
    Friction,
    GivenLoad,
    Lash,
    Lever,
    MassAt,
    NodeLash,
    PublishedLoad,
    Rocker,
    Spring,
    path_name,
    tip_name,
)


@dataclass(frozen=True, eq=False)
class Model:
    """A flexible mechanism: mesh, members, supports and everything attached to them.

    Parameters
    ----------
    mesh
        Nodes, members as chains, named points.
    members
        Member name to its data.
    supports
        Point name to the constrained components.
    masses, springs, rockers, cams, contacts, friction, loads
        Attached parts by name.
    gravity
        Acceleration, m/s^2, global axes.
    damping
        Damping of the whole structure.
    probes
        Output points: named nodes or points of rockers.
    superelements
        Elastic bodies between nodes by name, by their matrices; the mesh has their nodes as `bodies`.
    rigid_links
        Name of a rigid link to the components that follow; the mesh has its nodes as `links`.
    bearings
        Journal bearings with an oil film by name; elastic bearings are springs.

    Examples
    --------
    `flexcam.case.builder.build_model` creates a model; `flexcam.valvetrain.build_system` builds its equations.
    """

    mesh: Mesh
    members: Mapping[str, Member]
    supports: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    masses: Mapping[str, MassAt] = field(default_factory=dict[str, MassAt])
    springs: Mapping[str, Spring] = field(default_factory=dict[str, Spring])
    rockers: Mapping[str, Rocker] = field(default_factory=dict[str, Rocker])
    cams: Mapping[str, Cam] = field(default_factory=dict[str, Cam])
    contacts: Mapping[str, Contact] = field(default_factory=dict[str, Contact])
    friction: Mapping[str, Friction] = field(default_factory=dict[str, Friction])
    loads: Mapping[str, GivenLoad] = field(default_factory=dict[str, GivenLoad])
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    damping: Damping = field(default_factory=Damping)
    probes: tuple[str, ...] = ()
    superelements: Mapping[str, Superelement] = field(default_factory=dict[str, Superelement])
    rigid_links: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    bearings: Mapping[str, FilmBearing] = field(default_factory=dict[str, FilmBearing])

    def __reduce__(self) -> tuple[type[Model], tuple[object, ...]]:
        """Return the constructor and its arguments, for pickle and copy."""
        values = (getattr(self, one.name) for one in fields(self))
        return type(self), tuple(dict(one) if isinstance(one, Mapping) else one for one in values)  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]

    def __post_init__(self) -> None:
        for name in (one.name for one in fields(self) if isinstance(getattr(self, one.name), Mapping)):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def _repr_html_(self) -> str:
        """Return a table of the parts, for notebooks."""
        parts = (
            "members", "superelements", "masses", "springs", "bearings", "rockers", "cams", "contacts", "friction",
            "loads",
        )  # fmt: skip
        rows = {"nodes": str(len(self.mesh.nodes)), "probes": ", ".join(self.probes)}
        return html_table("Model", rows | {name: ", ".join(getattr(self, name)) for name in parts})

    @property
    def cam_contacts(self) -> dict[str, PublishedLoad | CamContact]:
        """Cam-follower contacts by name."""
        return {n: one for n, one in self.contacts.items() if isinstance(one, PublishedLoad | CamContact)}

    def lash_of(self, rocker: str) -> Lash | Adjuster | None:
        """Return the lash or the adjuster of a rocker.

        Parameters
        ----------
        rocker
            Its name.

        Returns
        -------
        Lash, Adjuster or None
            None if the rocker's point is rigidly connected.
        """
        plays = (one for one in self.contacts.values() if isinstance(one, Lash | Adjuster))
        return next((one for one in plays if one.rocker == rocker), None)

    @property
    def lashes(self) -> list[NodeLash]:
        """Lash and adjusters between nodes."""
        parts = [(name, one) for name, one in self.contacts.items() if isinstance(one, Lash | Adjuster)]
        return [
            NodeLash(name, one, one.ends, one.direction)
            for name, one in parts
            if one.ends and one.direction is not None
        ]

    def connected_nodes(self, node: int) -> IntArray:
        """Return the nodes connected to a node by members and links, including the node itself.

        Parameters
        ----------
        node
            Row of the mesh's `nodes`.

        Returns
        -------
        ndarray
            Rows of `nodes`, ascending, shape (k,).
        """
        points = self.mesh.points
        links = [(one.at, one.to) for one in self.springs.values() if one.link and one.to in points]
        pairs = [(self.mesh.node(a), self.mesh.node(b)) for a, b in links if a in points and b is not None]
        found = set(self.mesh.connected_nodes(node).tolist())
        while more := {n for pair in pairs if not found.isdisjoint(pair) for n in pair} - found:
            found.update(*(self.mesh.connected_nodes(n).tolist() for n in more))
        return np.array(sorted(found), dtype=np.intp)

    @property
    def levers(self) -> dict[str, Lever]:
        """Rotating rockers (levers) by name."""
        return {name: one for name, one in self.rockers.items() if isinstance(one, Lever)}

    @property
    def loose_points(self) -> dict[str, Rocker]:
        """Points with their own unknown, because their rocker has lash or is a lever, by name."""
        loose = {r.point: r for name, r in self.rockers.items() if self.lash_of(name) or isinstance(r, Lever)}
        return {**loose, **{r.start: r for r in self.rockers.values() if r.finger}}

    @property
    def further_unknowns(self) -> list[str]:
        """Names of the unknowns of rockers: loose points, lever paths, and lever tips with lash."""
        paths = [path_name(name) for name, one in self.levers.items() if not one.finger]
        return [*self.loose_points, *paths, *(tip_name(name) for name in self.levers if self.lash_of(name))]

    @property
    def superelement_modes(self) -> dict[str, list[str]]:
        """Names of the unknowns of the modes of every superelement."""
        return {n: [f"superelements.{n}.{i}" for i in range(1, one.modes + 1)] for n, one in self.superelements.items()}

    def rocker_at(self, point: str) -> Rocker | None:
        """Return the rocker that defines a point.

        Parameters
        ----------
        point
            Name of the point.

        Returns
        -------
        Rocker or None
            None where no rocker defines it.
        """
        own = (r for r in self.rockers.values() if point == r.point or (point == r.start and r.finger))
        return next(own, None)
