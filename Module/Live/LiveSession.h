// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// LiveTraining on a thread of its own: frames are handed over at once, slices are served between two steps.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "Live/LiveTraining.h"

namespace bigus
{

/// May be used by several threads. What goes wrong on the session's own thread is thrown by the next call.
class LiveSession
{
public:
  /// Starts to train. Throws Error when an option is out of range.
  explicit LiveSession(LiveOptions options);
  /// Stops. Whoever still waits for a slice must not be left when this is called.
  ~LiveSession();
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  /// Throws Error where LiveTraining would refuse frames of this size, before they are read.
  void RequireRoom(int width, int height) const { options_.KeptFrames(width, height); }

  /// Hands a frame over and returns at once. When more than 64 frames wait, the oldest of them is dropped.
  void Add(LiveFrame frame);

  /// Returns when no frame waits.
  void Wait();

  /// LiveTraining::Render of the field as it is now. Returns within about one optimizer step.
  void Render(const SlicePlane& plane, ViewOutput output, float* image, float* coverage = nullptr);

  /// The field as it is now; empty before it has begun.
  GaussianField Field();

  struct State
  {
    std::size_t frames = 0;      ///< kept to train on
    std::size_t passedOver = 0;  ///< black, repeated or late
    std::size_t dropped = 0;     ///< because too many waited
    std::size_t refused = 0;     ///< unsound
    std::string lastError;       ///< why the last of those was refused
    std::size_t waiting = 0;     ///< handed over and not yet looked at
    std::size_t gaussians = 0;
    std::size_t steps = 0;
  };
  State GetState() const;

  /// Waits until all frames handed over were looked at, then LiveTraining::Finish. Meanwhile slices are served of the
  /// field as it was before. `progress` is called by the session's thread.
  LiveResult Finish(double seconds, const ProgressCallback& progress = {});

private:
  using Task = std::function<void(LiveTraining&)>;
  void Run();
  void Ask(const Task& task, std::deque<Task>& queue);
  bool Serve(LiveTraining& training);
  void TakeFrames(LiveTraining& training);

  const LiveOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<LiveFrame> frames_;
  std::deque<Task> requests_;  // answered between two steps
  std::deque<Task> jobs_;      // answered once no frame waits
  State state_;
  std::exception_ptr failure_;
  bool stop_ = false;
  bool isFinished_ = false;  // for the session's thread: a job has finished the field
  std::thread thread_;       // last, since it uses all others
};

}  // namespace bigus
