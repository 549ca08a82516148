// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Every number among a phantom's options once: its name, range, unit and meaning. The check of ranges, the VTK source, the
// command, ParaView's panel and Python walk this list.
#pragma once

#include "Core/Phantom/PhantomOptions.h"

namespace bigus
{

/// What the list says of one number.
struct PhantomNumber
{
  /// "PixelSize", from which other spellings follow: --pixel-size of the command, pixel_size in Python.
  const char* name;
  const char* group;   ///< heading in the command's help
  const char* help;    ///< one sentence without its full stop
  double least, most;  ///< range, both ends allowed
  const char* unit = "";
  bool zeroIsProbes = false;  ///< 0, which lies outside the range, stands for the probe's default
};

/// Calls visit(number, member) for how many frames there are and how large they are, which VTK's source names in its own
/// way. `Options` is PhantomOptions, const or not.
template <class Options, class Visit>
void ForEachPhantomSize(Options& options, const Visit& visit)
{
  const char *probe = "Probe and image", *course = "Trajectory and tracking";
  visit(PhantomNumber{"Width", probe, "Pixels across; 0: 256 (linear) or 384", 8, 8192, "pixels", true}, options.width);
  visit(PhantomNumber{"Height", probe, "Pixels in depth", 8, 8192, "pixels"}, options.height);
  visit(PhantomNumber{"Frames", course, "Frames of the sweep", 1, 100000}, options.frames);
}

/// The same for all other numbers. Members are int, std::int64_t, double or three doubles.
template <class Options, class Visit>
void ForEachPhantomNumber(Options& o, const Visit& visit)
{
  using Number = PhantomNumber;
  constexpr double kLargestSeed = 9007199254740992.0;  // 2^53: up to there every whole number is a double

  const char* world = "World";
  visit(Number{"Seed", world, "Seed of scatterers, hand and tracker; the anatomy stays", 0, kLargestSeed}, o.seed);
  visit(Number{"ScattererDensity", world, "Scatterers per mm^3 of parenchyma", 1, 1000}, o.scattererDensity);
  visit(Number{"Attenuation", world, "One way, in parenchyma, dB / (cm MHz)", 0, 3, "dB"}, o.attenuation);

  const char* probe = "Probe and image";
  visit(Number{"PixelSize", probe, "Side of a pixel", 0.01, 5, "mm"}, o.pixelSize);
  visit(Number{"ProbeRadius", probe, "Radius of the fan's start; 0: 25 (convex) or 4 (sector)", 2, 500, "mm", true},
        o.probeRadius);
  visit(
      Number{"HalfAngle", probe, "The fan's reach to each side; 0: 32 (convex) or 44 (sector)", 1, 80, "degrees", true},
      o.halfAngle);
  visit(Number{"Frequency", probe, "Of the axial carrier", 0.5, 50, "MHz"}, o.frequency);
  visit(Number{"AxialSigma", probe, "Resolution along the beam, standard deviation", 0.02, 5, "mm"}, o.axialSigma);
  visit(Number{"LateralSigma", probe, "Resolution across the beam, standard deviation", 0.02, 5, "mm"}, o.lateralSigma);
  visit(Number{"ElevationSigma", probe, "Thickness of the beam out of plane, standard deviation", 0.05, 10, "mm"},
        o.elevationSigma);
  visit(Number{"DynamicRange", probe, "Between black and white", 10, 120, "dB"}, o.dynamicRange);
  visit(Number{"WhiteLevel", probe, "Above parenchyma's root-mean-square echo, shown white", -40, 100, "dB"},
        o.whiteLevel);

  const char* course = "Trajectory and tracking";
  visit(Number{"FrameSpacing", course, "Mean travel between frames", 0, 20, "mm"}, o.frameSpacing);
  visit(Number{"SpeedVariation", course, "Share by which the spacing varies", 0, 0.95}, o.speedVariation);
  visit(Number{"Tilt", course, "Bound of the probe's three angles", 0, 45, "degrees"}, o.tilt);
  visit(Number{"Wander", course, "Bound of motion sideways and in depth", 0, 20, "mm"}, o.wander);
  visit(Number{"SweepAngle", course, "Turns the whole sweep about the depth axis", -360, 360, "degrees"}, o.sweepAngle);
  visit(Number{"Shake", course, "Standard deviation by which the probe itself shakes, which frames show", 0, 10, "mm"},
        o.shake);
  visit(Number{"ShakeRotation", course, "The same of its angles", 0, 20, "degrees"}, o.shakeRotation);
  visit(Number{"ShakeCorrelation", course, "Pictures over which it is correlated by 1/e; 0: each by itself", 0, 1000,
               "pictures"},
        o.shakeCorrelation);
  visit(Number{"FrameRate", course, "Frames a second", 0.1, 10000, "Hz"}, o.frameRate);
  visit(Number{"Passes", course, "Goes over the path so often, there and back", 1, 100}, o.passes);
  visit(Number{"DroppedShare", course, "Share of the pictures taken that are lost", 0, 0.9}, o.droppedShare);

  const char* tracker = "Errors of the tracker, which move recorded poses only";
  visit(Number{"TrackingNoise", tracker, "Standard deviation of recorded positions", 0, 10, "mm"}, o.trackingNoise);
  visit(Number{"TrackingRotationNoise", tracker, "Standard deviation of recorded angles", 0, 20, "degrees"},
        o.trackingRotationNoise);
  visit(Number{"NoiseCorrelation", tracker,
               "Frames over which the tracker's noise is correlated by 1/e; 0: each frame errs by itself", 0, 1000,
               "frames"},
        o.noiseCorrelation);
  visit(Number{"TrackingDrift", tracker, "Bound of a slow drift of positions", 0, 100, "mm"}, o.trackingDrift);
  visit(Number{"TrackingRotationDrift", tracker, "Bound of a slow drift of angles", 0, 20, "degrees"},
        o.trackingRotationDrift);
  visit(Number{"OutlierShare", tracker, "Share of frames recorded far off", 0, 0.5}, o.outlierShare);
  visit(Number{"OutlierSize", tracker, "How far off they are", 0, 100, "mm"}, o.outlierSize);
  visit(Number{"TrackingDelay", tracker, "A frame has the pose of so long before it was taken", -1, 1, "s"},
        o.trackingDelay);
  visit(Number{"TrackingQuantum", tracker, "Positions are rounded to multiples; 0: not", 0, 10, "mm"},
        o.trackingQuantum);
  visit(Number{"TrackingRotationQuantum", tracker, "Angles are rounded to multiples; 0: not", 0, 20, "degrees"},
        o.trackingRotationQuantum);
  visit(Number{"CalibrationShift", tracker, "Error of the image on the probe: along its rows, down, along its normal",
               -100, 100, "mm"},
        o.calibrationShift);
  visit(Number{"CalibrationRotation", tracker,
               "Error of the image on the probe about its centre: axis times angle in these axes", -45, 45, "degrees"},
        o.calibrationRotation);
}

/// Both.
template <class Options, class Visit>
void ForEachPhantomOption(Options& options, const Visit& visit)
{
  ForEachPhantomSize(options, visit);
  ForEachPhantomNumber(options, visit);
}

}  // namespace bigus
