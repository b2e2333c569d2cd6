"""OpenCV, imported where it is used: it belongs to the extra `bench`."""

import os
from types import ModuleType

from bender_loop.errors import InputError
from bender_loop.shell.extras import install_command

# OpenCV waits ten seconds for a V4L2 device that was unplugged; it reads this once, when it is imported.
_V4L2_PATIENCE = ("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
# holds something once OpenCV was set up
_quiet: list[bool] = []


def import_cv2() -> ModuleType:
    """Import OpenCV and hold it to one thread: the bench's frames are small and its cores are few.

    Raises:
        InputError: OpenCV is not installed.
    """
    os.environ.setdefault(*_V4L2_PATIENCE)
    # what FFmpeg and OpenCV say on the standard error is said again, in one line, by whoever calls
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    try:
        import cv2
    except ImportError as error:
        raise InputError(f"OpenCV cannot be imported ({error}); install it with: {install_command('bench')}") from None
    if not _quiet:
        cv2.setNumThreads(1)
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        _quiet.append(True)
    return cv2
