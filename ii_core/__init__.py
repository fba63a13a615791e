"""Cameras, pictures, component images and view images of integral imaging."""

from .calibration import Calibration, NoLenses, calibrate, calibrated_picture, centres_picture, defective_pixels
from .camera.camera import Camera, IICamera
from .camera.maps import MapCamera, read_maps, write_maps
from .camera.pose import camera_pose
from .camera.presets import camera_names, preset, preset_cameras
from .depth.estimate import DepthEstimate, estimate_depth
from .depth.refocus import focused
from .depth.retarget import Retargeted, retarget
from .design.panel import PanelDesign, panel_display
from .display.eye import Eye, EyeImage, eye_image
from .display.model import DisplayModel
from .display.notebook import EmbeddedViewer, embed_viewer
from .display.zones import ViewingZone, converging_distance, crosstalk, viewing_zone
from .formats.find import find_views, picture_of
from .formats.hci import write_hci
from .formats.mosaic import load_mosaic
from .formats.quilt import write_quilt
from .formats.rig import Rig
from .formats.views import write_views
from .picture.assumed import with_assumed_camera
from .picture.component import component_images, elementary_images, picture_pixels, ray_space_images, sub_images
from .picture.disparity import depth_of_disparity, disparity_of_depth
from .picture.picture import IIPicture
from .picture.regular import from_smallest_rectangle, resampled, smallest_rectangle
from .picture.sensor_noise import add_sensor_noise
from .picture.view import five_viewpoints, orthoscopic, projection_camera, refocus, stand_back, view_image
from .video.video import IIVideo, open_video, video_of, write_view_folders

__all__ = [
    "Calibration",
    "Camera",
    "DepthEstimate",
    "DisplayModel",
    "EmbeddedViewer",
    "Eye",
    "EyeImage",
    "IICamera",
    "IIPicture",
    "IIVideo",
    "MapCamera",
    "NoLenses",
    "PanelDesign",
    "Retargeted",
    "Rig",
    "ViewingZone",
    "add_sensor_noise",
    "calibrate",
    "calibrated_picture",
    "camera_names",
    "camera_pose",
    "centres_picture",
    "component_images",
    "converging_distance",
    "crosstalk",
    "defective_pixels",
    "depth_of_disparity",
    "disparity_of_depth",
    "elementary_images",
    "embed_viewer",
    "estimate_depth",
    "eye_image",
    "find_views",
    "five_viewpoints",
    "focused",
    "from_smallest_rectangle",
    "load_mosaic",
    "open_video",
    "orthoscopic",
    "panel_display",
    "picture_of",
    "picture_pixels",
    "preset",
    "preset_cameras",
    "projection_camera",
    "ray_space_images",
    "read_maps",
    "refocus",
    "resampled",
    "retarget",
    "smallest_rectangle",
    "stand_back",
    "sub_images",
    "video_of",
    "view_image",
    "viewing_zone",
    "with_assumed_camera",
    "write_hci",
    "write_maps",
    "write_quilt",
    "write_view_folders",
    "write_views",
]
