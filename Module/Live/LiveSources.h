// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Where the frames of `bigus live` come from while they arrive: an OpenIGTLink server, or a table that grows.
#pragma once

#include <Eigen/Dense>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "Console.h"
#include "Core/Model/SlicePlane.h"
#include "Inputs.h"
#include "Live/LiveSession.h"
#include "Live/SliceServer.h"

namespace bigus::command
{

struct LiveSource
{
  SequenceOptions sequence;
  std::string device, transform, plane;  ///< devices of an OpenIGTLink server: of pictures, of poses, of slices
  std::vector<int> sliceSize{256, 256};  ///< pixels of the slice that is sent back
  int listen = 0;                        ///< port at which clients ask for slices; 0: none
  double pause = 3;                      ///< s without a frame after which the probe counts as lifted
  double reconnect = 10;                 ///< s for which a server that went away is waited for
};

/// Seconds between two looks at the field while frames arrive.
constexpr double kLook = 0.1;

constexpr int kNumbersOfGaussian = 7;

/// Takes slices of a session's field, and how long they take to come.
class Looker
{
public:
  explicit Looker(LiveSession& session) : session_(session) {}

  /// The picture now.
  const std::vector<float>& Look(const Eigen::Matrix4d& imageToReference, int width, int height);
  /// The picture, and after it the coverage of each of its pixels.
  const std::vector<float>& LookWithCoverage(const Eigen::Matrix4d& imageToReference, int width, int height);
  /// The probe is where the newest frame is.
  void MoveProbe(const Eigen::Matrix4d& imageToReference, int width, int height);
  /// The picture where the probe is, after a MoveProbe.
  void LookAtProbe();

  /// At most so many Gaussians, evenly taken: kNumbersOfGaussian numbers for each, the place (mm), the reflectivity and the
  /// scales (mm).
  std::vector<float> Gaussians(std::size_t most) const;

  /// The pose and size of the newest frame; null before there was one.
  Json ProbeJson() const;

  Json ToJson() const;
  std::string Text() const;

private:
  const std::vector<float>& Render(const SlicePlane& plane, bool withCoverage);

  LiveSession& session_;
  std::optional<SlicePlane> probe_;
  std::vector<float> image_;
  std::vector<double> latencies_;  // ms
};

/// What happened besides frames.
struct LiveEvents
{
  std::size_t refused = 0;     ///< messages or rows that were no frame, pose or plane
  std::string lastRefusal;     ///< why the last of those was refused
  std::size_t reconnects = 0;  ///< times that a server went away and was there again
};

/// How the program is: for clients, and for scripts in a file of JSON.
class LiveStatus
{
public:
  /// `path` may be empty: then nothing is written.
  LiveStatus(std::string path, const LiveSession& session, const Looker& looker, Console& console);

  /// Writes the file anew when the phase is another one, or the last time is a second ago. `fraction` is how much of the
  /// phase is done, where that is known, else below 0. A file that cannot be written is a note, once.
  void Tell(const std::string& phase, const LiveEvents& events, double fraction = -1);

  /// The phase that was told last, what became of frames until now, and where the probe is.
  Json Now() const;

private:
  std::string path_, phase_ = "following";
  LiveEvents events_;
  double fraction_ = -1;
  const LiveSession& session_;
  const Looker& looker_;
  Console& console_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now(), written_;
  bool hasFailed_ = false;
};

/// Hands over what a server sends. Returns when no frame came for as long as a pause, when the server went away for longer
/// than it is waited for, or when the program is interrupted. Throws Error when nobody listens there at first, and when
/// several devices send pictures and it is not said whose are followed.
LiveEvents FollowServer(const LiveSource& source, LiveSession& session, Looker& looker, SliceServer& slices,
                        LiveStatus& status, Console& console);

/// Hands over the rows of a CSV of poses, with their PNGs, as they are written. Returns when no row came for as long as a
/// pause, or when the program is interrupted. Throws Error when the file is no such table.
LiveEvents FollowTable(const LiveSource& source, LiveSession& session, Looker& looker, SliceServer& slices,
                       LiveStatus& status, Console& console);

}  // namespace bigus::command
