// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field that grows frame by frame while the probe moves. Nothing here depends on a clock, so equal calls give equal
// bits; LiveSession.h adds the thread.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/GaussianField.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"
#include "Core/Trainer/Trainer.h"
#include "Core/Training/TrainerOptions.h"
#include "Core/Training/TrainingProgress.h"

namespace bigus
{

/// Frames that a LiveSession lets wait: three seconds at 20 frames a second. A session that is further behind could not be
/// called live.
constexpr std::size_t kMostWaitingFrames = 64;

struct LiveOptions
{
  /// Seed, engine, loss, rates and beam of the steps, and all that Finish uses. `gaussians`, if set, is the number for
  /// every hundred frames; else a field is as large as what it was trained on (44 bytes for as many lit pixels).
  TrainerOptions training;
  int window = 64;                         ///< newest frames, which the steps learn from: 8 to 1024
  int batch = 4;                           ///< frames of a step: 1 to the window
  std::size_t maximumFrames = 2000;        ///< that Finish trains on: from the window to 10^6
  std::size_t maximumGaussians = 1000000;  ///< 1000 to 2^26; then no more are added
  /// Bytes, above 0, that pixels of frames may take together: of those kept, which Finish copies, of the window's and of those
  /// that wait. What else training needs comes on top.
  double memory = 4e9;

  /// Throws Error naming the option, its value and its range.
  void Validate() const;

  /// How many frames of this size are kept: the maximum, or as many as the memory has room for. Throws Error where it has
  /// none for the window's.
  std::size_t KeptFrames(int width, int height) const;
};

/// A frame as the scanner and the tracker gave it.
struct LiveFrame
{
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< [height][width]
  Eigen::Matrix4d imageToReference = Eigen::Matrix4d::Identity();
  double timestamp = 0;  ///< s
};

/// What a field is when the probe was lifted and all its frames were trained on together.
struct LiveResult
{
  TrainingResult training;
  std::shared_ptr<const Sweep> sweep;  ///< what it was trained on, at the poses that came
};

/// Frames come in by Add, optimizer steps are taken by Step, slices can be rendered after any of them.
///
/// Gaussians are seeded a few frames at a time, where those of the field do not cover these frames enough yet. So a probe
/// that stands still or comes back hardly makes the field larger. Every step learns from a batch of newest frames, and a
/// Gaussian's steps become shorter the more of them it took.
/// Finish then trains on all frames together.
class LiveTraining
{
public:
  /// Throws Error when an option is out of range.
  explicit LiveTraining(LiveOptions options);
  ~LiveTraining();

  /// Takes a frame. False when it is passed over, because it is black (the probe is not on the skin), or its time is not
  /// after the last frame's (it was repeated, or comes late). Throws Error, and takes nothing, for a frame of another size
  /// than the first, one too large for the memory, or with a pose or time that is unsound.
  bool Add(LiveFrame frame);

  /// Seeds the frames that wait for more to be seeded with, at most seven. To be called when no frame comes for a while.
  void SeedWaiting();

  /// One optimizer step on the newest frames. False, and nothing happens, while there is no field yet.
  bool Step();

  /// Called several times while frames are seeded, which takes as long as many steps; Field and Render may be called then.
  void SetInterlude(std::function<void()> interlude) { interlude_ = std::move(interlude); }

  /// Whether there is a field: it begins with the eighth frame that shows anything.
  bool HasField() const { return engine_->FieldSize() > 0; }

  /// The field so far; empty before it has begun.
  GaussianField Field() const;

  /// The picture at a plane, as Engine::Render; black before the field has begun.
  void Render(const SlicePlane& plane, ViewOutput output, float* image, float* coverage = nullptr);

  /// Trains on all frames for so many seconds (> 0), from the field so far, with the tracker's noise taken out. The
  /// field and its sweep are then those of the result; frames may come in again afterwards. Throws Error when there is no
  /// field.
  LiveResult Finish(double seconds, const ProgressCallback& progress = {});

  /// The frames that Finish trains on, oldest first. Where there were more than the maximum, those are left out that lay
  /// nearest to their predecessors.
  Sweep Frames() const;

  std::size_t NumberOfFrames() const { return frames_.size(); }
  std::size_t NumberOfGaussians() const { return engine_->FieldSize(); }
  std::size_t NumberOfSteps() const { return steps_; }

private:
  void Pause() const
  {
    if (interlude_)
    {
      interlude_();
    }
  }
  void Absorb();
  GaussianField SeedsFor(const Sweep& chunk, const std::vector<int>& frames);
  GaussianField FreshSeeds(const Sweep& chunk, const std::vector<int>& frames);
  void KeepWhatIsMissing(const Sweep& chunk, const std::vector<int>& frames, GaussianField& seeds,
                         std::vector<std::vector<float>>& scattering);
  void ScaleToWhatIsMissing(const Sweep& chunk, const std::vector<int>& frames,
                            const std::vector<std::vector<float>>& scattering, GaussianField& seeds);
  void UploadWindow(const Sweep& chunk);
  void ThinOut();

  LiveOptions options_;
  std::function<void()> interlude_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<Engine> seedEngine_;
  std::deque<LiveFrame> frames_;         // all that are kept
  std::deque<LiveFrame> targets_;        // the newest, with planes between them
  std::vector<double> moved_;            // [frames_] mm from the one before
  std::size_t kept_ = 0;                 // most of frames_
  std::size_t waiting_ = 0;              // of frames_, the newest, that have no seeds yet
  std::shared_ptr<const Sweep> recent_;  // what steps learn from
  struct Shape;
  std::unique_ptr<Shape> shape_;  // what the first frames tell of all
  double lastTime_ = 0;
  std::size_t steps_ = 0;
  std::mt19937_64 random_;
};

}  // namespace bigus
