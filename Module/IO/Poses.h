// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// From the transforms of a sequence to one pose a frame.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <string>
#include <vector>

#include "IO/SequenceFile.h"

namespace bigus
{

struct PoseOptions
{
  std::string fromFrame = "Image";
  std::string toFrame = "Reference";
  std::string configFileName;                   ///< Plus XML with further transforms; empty: none
  std::array<double, 2> imageSpacing = {0, 0};  ///< mm of a pixel along i and j, instead of the matrices'; 0: theirs
  bool assumeMissingStatusOK = false;
  bool allowReflectedPoses = false;  ///< a left-handed pose keeps its third column
  bool required = true;              ///< false: where there is no transform at all, frames are accepted without a pose
};

struct FramePose
{
  Eigen::Matrix4d imageToReference;  ///< NaN for a rejected frame; means nothing without a chain
  bool accepted = false;
  bool hasMadeAxis = false;  ///< the file's third column is zero or points the other way; the first two are the file's
};

struct TransformName
{
  std::string from;
  std::string to;
  std::string source;  ///< "frames", "header" or "config"

  std::string Name() const { return from + "To" + to; }
};

struct Rejection
{
  std::string reason;
  std::vector<int> frames;
};

struct PoseTable
{
  std::vector<TransformName> transforms;  ///< all there are, per-frame ones first
  std::string chain;                      ///< such as "Image -> Probe -> Tracker -> Reference"; empty: no poses
  std::vector<FramePose> frames;          ///< [frames]
  std::vector<double> timestamps;         ///< [frames], NaN where there is none
  std::vector<Rejection> rejections;      ///< in the order of their first frames

  int NumberOfAcceptedFrames() const;

  /// Indices of the accepted frames, or of all.
  std::vector<int> Kept(bool keepsRejected) const;

  /// Of the accepted frames those whose third column was made.
  int NumberOfMadeAxes() const;

  /// Such as "3 of 21 frames rejected: 2 for ProbeToTracker status INVALID (frames 4, 5), 1 for ..."; empty
  /// for none.
  std::string RejectionSummary() const;

  /// Throws FileError, with the summary, when no frame is accepted.
  void RequireFrames(const std::string& fileName) const;

  /// The coordinate frame, among the transforms there are, whose name is "Cropped" and `fromFrame`; empty without one.
  std::string CroppedFrame(const std::string& fromFrame) const;
};

/// The sentence that tells that the header states another size of a pixel than the poses; empty where it does not.
std::string SpacingDoubt(const SequenceFile& file, const PoseTable& table);

/// Fills `table` as far as it gets. Throws FileError when there is no way from one frame to the other, naming
/// the transforms there are and the coordinate frames that can be reached, and when the configuration cannot
/// be read. A frame whose own transforms will not do is rejected, not an error.
void ResolvePoses(const SequenceFile& file, const PoseOptions& options, PoseTable& table);

/// Sentences on what is doubtful: a cropped frame, third columns that were made, times, the size of a pixel.
std::vector<std::string> CautionsOf(const std::string& fileName, const SequenceFile& file, const PoseOptions& options,
                                    const PoseTable& table);

}  // namespace bigus
