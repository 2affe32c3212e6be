"""Model of a valve train: mesh, members and parts, without matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from flexcam.fem.assembly import Damping, Member
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
    reactions
        Supports whose reactions are channels.
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
    reactions: tuple[str, ...] = ()
    superelements: Mapping[str, Superelement] = field(default_factory=dict[str, Superelement])
    rigid_links: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    bearings: Mapping[str, FilmBearing] = field(default_factory=dict[str, FilmBearing])

    def __reduce__(self) -> tuple[type[Model], tuple[object, ...]]:
        values = (getattr(self, item.name) for item in fields(self))
        return type(self), tuple(dict(value) if isinstance(value, Mapping) else value for value in values)  # pyright: ignore[reportUnknownArgumentType, reportUnknownVariableType]

    def __post_init__(self) -> None:
        for name in (item.name for item in fields(self) if isinstance(getattr(self, item.name), Mapping)):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __repr__(self) -> str:
        """Return the number of nodes and the names of the parts."""
        names = "members", "superelements", "masses", "springs", "bearings", "rockers", "cams", "contacts", "loads"
        parts = [f"{name} {', '.join(getattr(self, name))}" for name in names if getattr(self, name)]
        return f"<Model, {'; '.join([f'{len(self.mesh.nodes)} nodes', *parts])}>"

    @property
    def cam_contacts(self) -> dict[str, PublishedLoad | CamContact]:
        """Cam-follower contacts by name."""
        return {n: contact for n, contact in self.contacts.items() if isinstance(contact, PublishedLoad | CamContact)}

    @property
    def rocker_lashes(self) -> dict[str, Lash | Adjuster]:
        """Lash and adjusters at rockers, by the name of the rocker."""
        return {c.rocker: c for c in self.contacts.values() if isinstance(c, Lash | Adjuster) and c.rocker}

    @property
    def lashes(self) -> list[NodeLash]:
        """Lash and adjusters between nodes."""
        return [
            NodeLash(lash.ends, lash.direction, lash.gap if isinstance(lash, Lash) and not lash.turns else 0.0)
            for lash in self.contacts.values()
            if isinstance(lash, Lash | Adjuster) and lash.ends and lash.direction is not None
        ]

    @property
    def levers(self) -> dict[str, Lever]:
        """Rotating rockers (levers) by name."""
        return {name: rocker for name, rocker in self.rockers.items() if isinstance(rocker, Lever)}

    @property
    def rocker_points(self) -> dict[str, Rocker]:
        """Rockers by the name of the points that they define: the driven one, and that of a finger at its cam."""
        rockers = self.rockers.values()
        return {r.point: r for r in rockers} | {r.start: r for r in rockers if r.finger}

    @property
    def loose_points(self) -> list[str]:
        """Points with their own unknown, because their rocker has lash or is a lever."""
        fixed = {r.point for n, r in self.rockers.items() if n not in self.rocker_lashes and not isinstance(r, Lever)}
        return [point for point in self.rocker_points if point not in fixed]

    @property
    def further_unknowns(self) -> list[str]:
        """Names of the unknowns of rockers: loose points, lever paths, and lever tips with lash."""
        paths = [path_name(name) for name, lever in self.levers.items() if not lever.finger]
        return [*self.loose_points, *paths, *(tip_name(name) for name in self.levers if name in self.rocker_lashes)]

    @property
    def inner_unknowns(self) -> dict[str, list[str]]:
        """Names of the unknowns inside springs with several parts and superelements, by the path of the part."""
        counts = {f"springs.{name}": spring.elements - 1 for name, spring in self.springs.items()}
        counts |= {f"superelements.{name}": body.modes for name, body in self.superelements.items()}
        return {part: [f"{part}.{i}" for i in range(1, count + 1)] for part, count in counts.items()}
