# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Options of functions and filters by their VTK names, with their defaults. Types for editors are made from them."""

POSES = {"ConfigFileName": "", "FromFrame": "Image", "ToFrame": "Reference", "ImageSpacing": (0.0, 0.0),
         "AssumeMissingStatusOK": False, "AllowReflectedPoses": False}
SEQUENCE = {**POSES, "ImageFolder": "", "ImagePattern": "", "PixelRange": 0.0, "AutoMask": True, "ClipMode": 0,
            "ClipRectangle": (0, 0, 0, 0), "FanApex": (0.0, 0.0), "FanRadii": (0.0, 0.0), "FanAngles": (-180.0, 180.0)}
SEQUENCE_OUTPUT = {"FromFrame": "Image", "ToFrame": "Reference", "Compression": True}
FIELD_OUTPUT = {"Rounding": False}
CORRECTION = {"Strength": -1.0, "HoldOut": 0}
SLICER = {"Engine": "auto", "ElevationSigma": -1.0, "Tolerance": 1e-4}
PHANTOM = {"NumberOfFrames": 64, "FrameSize": (0, 256)}  # VTK's names for `frames`, and for `width` and `height`
