"""
Oil film of a cam
=================

The lubricated contact of an overhead cam and a flat bucket: ratio of minimum film and roughness along the profile.
"""

import numpy as np

import flexcam
from flexcam.cams import cam_profile, profile_at
from flexcam.plotting.curves import profile_figure

OIL = 'contacts.intake.lubrication={viscosity="10 mPa s",pressure_viscosity="15 1/GPa",roughness="0.3 um"}'

case = flexcam.read_case("../cases/direct-acting/bucket.toml", [OIL])
response, cam = flexcam.run(case), flexcam.build_model(case).cams["intake"]
ratio = response.channels["contacts.intake.lambda"]
contact = profile_at(cam.event, cam.follower, response.angle, cam.turn)
profile = cam_profile(cam.event, cam.follower, turn=cam.turn)
figure = profile_figure(profile, angle=np.radians(230.0), coloured=(contact, ratio, "film over roughness"))

# %%
# On the flanks the entrainment velocity exceeds 20 m/s. On the nose it is small and has the opposite sign. At the
# change of sign the film of the steady formula is zero.
velocity = response.channels["contacts.intake.entrainment"]
nose = int(np.argmax(cam.event(response.angle)))
print(f"flank: {np.abs(velocity).max():.1f} m/s, film over roughness {ratio.max():.1f}")
print(f"nose: {velocity[nose]:.1f} m/s, film over roughness {ratio[nose]:.2f}")

assert velocity[nose] > 0.0 > velocity[0]
assert ratio[nose] < 1.0 < 3.0 < ratio.max()
