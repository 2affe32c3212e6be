"""
Settings of a valve spring
==========================

The closed form of Petrescu and Petrescu (2013) for one mass between a cam and a valve spring: stiffer springs with more
preload limit the acceleration of the valve at any speed, because the valve opens less and less.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import flexcam
from flexcam.plotting.figures import add_legend, create_stacked_axes, line_styles
from flexcam.valvetrain import free_speed

Speed = Callable[[np.ndarray, int], np.ndarray]  # camshaft speed or its derivative over the cam angle
CASE = "../cases/petrescu/valve-spring.toml"
SETTINGS = {  # crank speed, stiffness and installed compression of the valve spring
    "figure 2": ("5000 rpm", "40 kN/m", "90 mm"),
    "figure 3": ("10000 rpm", "40 kN/m", "90 mm"),
    "figure 4": ("20000 rpm", "200 kN/m", "200 mm"),
    "figure 5": ("30000 rpm", "300 kN/m", "500 mm"),
    "figure 6": ("40000 rpm", "600 kN/m", "500 mm"),
    "figure 7": ("50000 rpm", "900 kN/m", "600 mm"),
}

# %%
# The paper gives the motion x of the mass as a function of the lift s, of the stiffnesses K of the train and k of the
# spring and of its compression x0. The derivatives hold the speed constant, as the spreadsheet of the paper does.


@dataclass(frozen=True, eq=False)
class SingleMassModel:
    """Mass driven by a cam through an elastic train, against a valve spring."""

    event: flexcam.LiftEvent
    mass: float
    train_stiffness: float
    spring_stiffness: float
    compression: float

    @property
    def preload_deflection(self) -> float:
        """Deflection of the train under the preload, k x0/(K + k), m: the lift it absorbs."""
        return self.spring_stiffness * self.compression / (self.train_stiffness + self.spring_stiffness)

    @property
    def opens_valve(self) -> bool:
        """True if the force of the train at full lift exceeds the preload; otherwise the valve stays closed."""
        return self.train_stiffness * self.event.height > self.spring_stiffness * self.compression

    def motion(self, angle: np.ndarray, speed: np.ndarray, order: int = 0) -> np.ndarray:
        """Return x, or its first or second derivative by the cam angle."""
        s, s1, s2, s3 = (self.event(angle, k) for k in range(4))
        K, k = self.train_stiffness, self.spring_stiffness
        total = K + k
        inertia, square, linear = total * self.mass * speed**2, k * (k + 2.0 * K), 2.0 * k * self.compression * total
        N, D, scale = inertia * s1**2 + square * s**2 + linear * s, s + self.preload_deflection, 2.0 * total**2
        if order == 0:
            return s - N / (scale * D)
        N1 = 2.0 * inertia * s1 * s2 + 2.0 * square * s * s1 + linear * s1
        slope = (N1 * D - N * s1) / D**2
        if order == 1:
            return s1 - slope / scale
        N2 = 2.0 * inertia * (s2**2 + s1 * s3) + 2.0 * square * (s1**2 + s * s2) + linear * s2
        return s2 - ((N2 * D - N * s2) / D**2 - 2.0 * s1 * slope / D) / scale

    def accelerations(self, angle: np.ndarray, omega: Speed) -> tuple[np.ndarray, np.ndarray]:
        """Return the accelerations of the lift and of the mass, m/s^2, at a varying speed omega of the cam."""
        w, rate = omega(angle, 0), omega(angle, 0) * omega(angle, 1)
        lift = self.event(angle, 2) * w**2 + self.event(angle, 1) * rate
        return lift, self.motion(angle, w, 2) * w**2 + self.motion(angle, w, 1) * rate


# %%
# Masses, stiffnesses and the lift come from the case file, with the values of each setting. The cam turns freely, by
# its own inertia.


def read_setting(speed: str, stiffness: str, compression: str) -> tuple[SingleMassModel, Speed]:
    """Return the single-mass model of a setting, and the speed of its cam over the angle."""
    overrides = [f"run.crank_speed={speed}", f"springs.valve.stiffness={stiffness}",
                 f"springs.valve.installed_compression={compression}"]  # fmt: skip
    case = flexcam.read_case(CASE, overrides)
    model, drive = flexcam.build_model(case), case.record.run.free_running
    cam, spring = model.cams["valve"], model.springs["valve"]
    mass_model = SingleMassModel(
        cam.event, model.masses["tappet"].body.mass, model.cam_contacts["train"].stiffness,
        spring.stiffness, spring.installed_force / spring.stiffness,
    )  # fmt: skip
    return mass_model, free_speed(cam.event, cam.follower.base_radius, case.speed, drive.cam_mass, drive.follower_mass)


models = {name: read_setting(*setting) for name, setting in SETTINGS.items()}
angle = np.linspace(0.0, 0.5 * np.pi * (1.0 - 1e-7), 1001)  # the rise
results = {}
for name, (setting, omega) in models.items():
    lift, valve = setting.accelerations(angle, omega)
    opening = setting.motion(angle, omega(angle, 0)).max()
    results[name] = {"lift": (lift.max(), lift.min()), "valve": (valve.max(), valve.min()), "opening": opening}
    print(
        f"{name}: acceleration of the lift {lift.min():.0f} to {lift.max():.0f} m/s^2, of the valve {valve.min():.0f} "
        f"to {valve.max():.0f} m/s^2; opens {1e3 * opening:.2f} of {1e3 * setting.event.height:g} mm"
    )

# %%
# A lower acceleration means a smaller opening: in figure 7 it is 0.32 mm of 6 mm. The preload deflects the train
# instead, and even at full lift the train does not lift the valve off its seat.
assert results["figure 7"]["valve"][0] < 0.04 * results["figure 7"]["lift"][0]
assert results["figure 7"]["opening"] < 0.06 * models["figure 7"][0].event.height
assert [setting.opens_valve for setting, _ in models.values()] == [True, True, False, False, False, False]

figure, (upper, lower) = create_stacked_axes(("opening\nmm", "acceleration\nkm/s²"), "cam angle, deg", height=2.4)
shown = ("figure 2", "figure 4", "figure 7")
for name, (colour, dashes) in zip(shown, line_styles(), strict=False):
    setting, omega = models[name]
    opening, acceleration = setting.motion(angle, omega(angle, 0)), setting.accelerations(angle, omega)[1]
    upper.plot(np.degrees(angle), 1e3 * opening, label=name, color=colour, linestyle=dashes)
    lower.plot(np.degrees(angle), 1e-3 * acceleration, color=colour, linestyle=dashes)
add_legend(figure, upper)
