"""The pinhole camera both programs mean, and how Blender's lens becomes one.

World: right-handed, Z up, metres. Pixels: origin at the top-left corner, centres at +0.5.

    Blender's camera axes          ours (OpenCV's)
        y up                          z forward
        |  -z forward                /
        | /                         +---- x right
        +---- x right               |
                                    y down
"""

from dataclasses import dataclass

import numpy as np

from .errors import CameraError

RIGID_TOLERANCE = 1e-4
SHEAR_TOLERANCE = 1e-5
KEYS = ("width", "height", "intrinsics", "world_from_camera")
OPENCV_FROM_BLENDER_AXES = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera: what it sees, on which pixel grid, from where.

    Attributes:
        width: Pixel columns.
        height: Pixel rows.
        intrinsics: (3, 3) float64 `[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]` in pixels.
        world_from_camera: (4, 4) float64 rigid transform, metres, camera axes as drawn above.

    Raises:
        CameraError: If a number is not finite, a size or focal length is not positive, or
            `world_from_camera` is more than a rotation and a translation.
    """

    width: int
    height: int
    intrinsics: np.ndarray
    world_from_camera: np.ndarray

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)
        for name, shape in (("intrinsics", (3, 3)), ("world_from_camera", (4, 4))):
            matrix = _float_matrix(name, getattr(self, name), shape)
            matrix.setflags(write=False)
            object.__setattr__(self, name, matrix)
        _check_intrinsics(self.intrinsics)
        _check_rigid(self.world_from_camera)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Camera):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple:
        # Adding 0.0 turns -0.0 into 0.0: cameras that compare equal must hash equal.
        numbers = (self.intrinsics + 0.0).tobytes(), (self.world_from_camera + 0.0).tobytes()
        return self.width, self.height, *numbers

    def as_dict(self) -> dict:
        """Plain numbers and lists, ready for JSON; `from_dict` restores the same bits."""
        return {
            "width": self.width,
            "height": self.height,
            "intrinsics": self.intrinsics.tolist(),
            "world_from_camera": self.world_from_camera.tolist(),
        }

    @staticmethod
    def from_dict(d: object, where: str = "camera") -> "Camera":
        """Read what `as_dict` wrote.

        Args:
            d: The four keys, nothing else.
            where: Names the place in error messages, for example `shot.cameras[3]`.

        Raises:
            CameraError: If a key is missing or unknown, or a value is not a camera's.
        """
        if not isinstance(d, dict) or set(d) != set(KEYS):
            found = sorted(map(str, d)) if isinstance(d, dict) else type(d).__name__
            raise CameraError(
                f"{where}: expected the keys {', '.join(KEYS)}, found {found}; "
                "write cameras with Camera.as_dict"
            )
        try:
            _check_size(d["width"], d["height"])
            intrinsics = _float_matrix("intrinsics", d["intrinsics"], (3, 3))
            pose = _float_matrix("world_from_camera", d["world_from_camera"], (4, 4))
            return Camera(d["width"], d["height"], intrinsics, pose)
        except CameraError as error:
            raise CameraError(f"{where}: {error}") from error

    def scaled(self, width: int, height: int) -> "Camera":
        """The same view on another pixel grid; unequal factors make pixels non-square."""
        _check_size(width, height)
        stretch = np.diag([width / self.width, height / self.height, 1.0])
        return Camera(width, height, stretch @ self.intrinsics, self.world_from_camera)


@dataclass(frozen=True)
class BlenderLens:
    """The numbers of a Blender camera and its render settings that decide the projection.

    Names are Blender's. Lengths of lens and sensor in millimetres, resolution in pixels before
    `resolution_percentage` (0 to 100), shifts in shares of the fitted side of the frame.
    """

    type: str
    lens: float
    sensor_width: float
    sensor_height: float
    sensor_fit: str
    shift_x: float
    shift_y: float
    resolution_x: int
    resolution_y: int
    resolution_percentage: int
    pixel_aspect_x: float
    pixel_aspect_y: float


def camera_from_blender(lens: BlenderLens, matrix_world: np.ndarray) -> Camera:
    """The pinhole camera with which Blender would render (evaluated data in, one camera out).

    Args:
        lens: Evaluated camera and render settings.
        matrix_world: (4, 4) evaluated `world_from_object`; scale is ignored, as Blender does.

    Raises:
        CameraError: If the camera is not a perspective one, or is sheared or mirrored.
    """
    _check_lens(lens)
    width = lens.resolution_x * lens.resolution_percentage // 100
    height = lens.resolution_y * lens.resolution_percentage // 100
    if width < 1 or height < 1:
        raise CameraError(
            f"resolution {lens.resolution_x}x{lens.resolution_y} at "
            f"{lens.resolution_percentage} % leaves {width}x{height} pixels; raise the percentage"
        )
    return Camera(width, height, _intrinsics(lens, width, height), _rigid_pose(matrix_world))


def project(camera: Camera, world_points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where world points appear.

    Args:
        camera: The observer.
        world_points: (points, 3) metres.

    Returns:
        Pixels (points, 2) and planar depth (points,) in metres. A point at or behind the camera
        plane (depth <= 0) has no pixel: NaN.
    """
    points = np.asarray(world_points, dtype=np.float64)
    rotation = camera.world_from_camera[:3, :3]
    in_camera = (points - camera.world_from_camera[:3, 3]) @ rotation
    depth = in_camera[:, 2]
    safe = np.where(depth > 0, depth, np.nan)[:, None]
    focal = camera.intrinsics[[0, 1], [0, 1]]
    centre = camera.intrinsics[:2, 2]
    return in_camera[:, :2] / safe * focal + centre, depth


def _intrinsics(lens: BlenderLens, width: int, height: int) -> np.ndarray:
    squeeze = lens.pixel_aspect_x / lens.pixel_aspect_y
    fit, sensor = lens.sensor_fit, lens.sensor_width
    if fit == "VERTICAL":
        sensor = lens.sensor_height
    if fit == "AUTO":
        # AUTO measures the longer side against the sensor's width, even when that side stands.
        wide = width * lens.pixel_aspect_x >= height * lens.pixel_aspect_y
        fit = "HORIZONTAL" if wide else "VERTICAL"
    fitted = width if fit == "HORIZONTAL" else height / squeeze
    fx = lens.lens / sensor * fitted
    cx = width / 2 - lens.shift_x * fitted
    cy = height / 2 + lens.shift_y * fitted * squeeze
    return np.array([[fx, 0.0, cx], [0.0, fx * squeeze, cy], [0.0, 0.0, 1.0]])


def _rigid_pose(matrix_world: np.ndarray) -> np.ndarray:
    """Drop the scale, refuse shear and mirroring, turn Blender's camera axes into ours."""
    matrix = _float_matrix("matrix_world", matrix_world, (4, 4))
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if lengths.min() <= 0:
        raise CameraError(f"camera scale is {lengths.tolist()}; give it a scale other than zero")
    axes = matrix[:3, :3] / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() > SHEAR_TOLERANCE:
        raise CameraError(
            "camera is sheared (a scaled parent that is rotated against it); apply the parent's "
            "scale or parent the camera to an unscaled object"
        )
    if np.linalg.det(axes) < 0:
        raise CameraError(
            "camera is mirrored (negative scale on it or on a parent); make the scale positive"
        )
    left, _, right = np.linalg.svd(axes)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = left @ right, matrix[:3, 3]
    return pose @ OPENCV_FROM_BLENDER_AXES


def _check_lens(lens: BlenderLens) -> None:
    if lens.type != "PERSP":
        raise CameraError(
            f"camera type is {lens.type}; only a perspective camera is a pinhole: set its lens "
            "type to Perspective"
        )
    if lens.sensor_fit not in ("AUTO", "HORIZONTAL", "VERTICAL"):
        raise CameraError(
            f"sensor fit is {lens.sensor_fit!r}; expected AUTO, HORIZONTAL or VERTICAL"
        )
    sizes = ("lens", "sensor_width", "sensor_height", "pixel_aspect_x", "pixel_aspect_y")
    for name in (*sizes, "shift_x", "shift_y"):
        value = getattr(lens, name)
        if not np.isfinite(value) or (name in sizes and value <= 0):
            wanted = "a positive number" if name in sizes else "a finite number"
            raise CameraError(f"camera {name} is {value}; expected {wanted}")


def _check_size(width: object, height: object) -> None:
    for name, value in (("width", width), ("height", height)):
        if not isinstance(value, int) or isinstance(value, bool) or value < 1:
            raise CameraError(f"{name} is {value!r}; expected a whole number of pixels above 0")


def _check_intrinsics(matrix: np.ndarray) -> None:
    shape = [[matrix[0, 0], 0, matrix[0, 2]], [0, matrix[1, 1], matrix[1, 2]], [0, 0, 1]]
    if not np.array_equal(matrix, np.array(shape)) or min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise CameraError(
            f"intrinsics are {matrix.tolist()}; expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] "
            "with fx and fy above 0"
        )


def _check_rigid(matrix: np.ndarray) -> None:
    rotation = matrix[:3, :3]
    drift = np.abs(rotation.T @ rotation - np.eye(3)).max()
    rigid = drift <= RIGID_TOLERANCE and np.linalg.det(rotation) > 0
    if not rigid or not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise CameraError(
            f"world_from_camera is {matrix.tolist()}; expected a rotation (orthonormal, "
            "determinant +1) and a translation over the row 0 0 0 1"
        )


def _float_matrix(name: str, value: object, shape: tuple[int, int]) -> np.ndarray:
    """A float64 copy, so that nobody else's array can change a frozen camera."""
    try:
        matrix = np.array(value)
    except ValueError as error:  # rows of unequal length
        raise CameraError(f"{name} is not a matrix: {error}") from error
    if matrix.dtype.kind not in "iuf":
        raise CameraError(f"{name} holds something else than numbers: {value!r}")
    if matrix.shape != shape:
        raise CameraError(f"{name} has shape {matrix.shape}; expected {shape}")
    if not np.isfinite(matrix).all():
        raise CameraError(f"{name} holds NaN or infinity: {matrix.tolist()}")
    return matrix.astype(np.float64)
