"""Arrays of cameras as II-cameras: what a field of views needs to have L and D.

U×V cameras stand B apart in a plane and look the same way. Each has its picture shifted so that all see the same part
of the plane at distance Z₀, the plane of zero disparity. That plane is the lens plane of an II-camera. Its lenses are
the pixels of the views, δL = Z₀·s/f apart (s pixel pitch, f focal length of a camera). The viewing zones of all meet
in the plane of the cameras, Z₀ before it. Rays start there (``start_mm``), and the scene stands on both sides. Pixel
pitch and gap follow from Λ = δP·Z₀/B and the pitch U·δP = δL·(1 − Λ/Z₀) of elementary images. If U ≠ V, the
larger of both fills the pitch, and elementary images are packed.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..base.checks import length, whole_pair
from ..camera.camera import IICamera, Pair

FAR_DISPARITY = 1e-4  # pixels a view: with this the plane of zero disparity stands for infinity


@dataclass(frozen=True, kw_only=True)
class Rig:
    """Measures of an array of cameras.

    Parameters
    ----------
    baseline_mm : float
        B, from camera to camera, the same across and down.
    focal_mm, sensor_mm : float
        Focal length, and the longer side of the sensor, of each.
    focus_mm : float, optional
        Z₀, from the cameras to the plane of zero disparity; infinity if not given, for parallel cameras whose
        pictures are not shifted.

    Raises
    ------
    ValueError
        If a length is not positive.
    """

    baseline_mm: float
    focal_mm: float
    sensor_mm: float
    focus_mm: float | None = None

    def __post_init__(self) -> None:
        for name in ("baseline_mm", "focal_mm", "sensor_mm"):
            object.__setattr__(self, name, length(name, getattr(self, name)))
        if self.focus_mm is not None:
            object.__setattr__(self, "focus_mm", length("focus_mm", self.focus_mm))

    def camera(self, views: Pair, size: Pair, *, name: str = "views") -> IICamera:
        """Return the II-camera whose sub-images are the views.

        Parameters
        ----------
        views : (U, V)
            Cameras across and down.
        size : (K, L)
            Pixels of a view.

        Returns
        -------
        IICamera
            The cameras stand in the plane z = 0, the middle one on the axis: z is the distance from them.
        """
        (u, v), (k, l) = whole_pair("views", views), whole_pair("size", size)
        pixel = self.sensor_mm / max(k, l)
        focus = self.focus_mm
        if focus is None:
            focus = self.baseline_mm * self.focal_mm / pixel / FAR_DISPARITY
        lens = focus * pixel / self.focal_mm
        pitch = lens / (max(u, v) + lens / self.baseline_mm)
        gap = pitch * focus / self.baseline_mm
        return IICamera(
            name=name,
            pixels=(k * u, l * v),
            lenses=(k, l),
            pixel_pitch_mm=pitch,
            gap_mm=gap,
            lens_pitch_mm=(lens, lens),
            viewer_mm=focus,
            start_mm=focus,
            origin_mm=(0.0, 0.0, focus - gap),
            packed=u != v,
        )


def rig_of(camera: IICamera) -> Rig | None:
    """Return the array of cameras that `Rig.camera` would make a camera of; None of other cameras.

    Focal length and sensor are known by their ratio alone: the sensor is 36 mm wide.
    """
    if camera.viewer_mm is None or camera.start_mm != camera.viewer_mm or camera.front:
        return None
    return Rig(
        baseline_mm=camera.pixel_pitch_mm * camera.viewer_mm / camera.gap_mm,
        focal_mm=36 * camera.viewer_mm / (camera.lens_pitch_mm[0] * max(camera.lenses)),
        sensor_mm=36.0,
        focus_mm=camera.viewer_mm,
    )
