// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Live/LiveSession.h"

#include <chrono>
#include <future>
#include <memory>
#include <utility>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

/// Times that the newest frames are trained on when no more come, after which the thread rests.
constexpr int kPassesAtRest = 16;

/// Time without a frame, after which those that wait for more are seeded.
constexpr std::chrono::milliseconds kPause(250);

using Clock = std::chrono::steady_clock;

}  // namespace

LiveSession::LiveSession(LiveOptions options) : options_(std::move(options))
{
  options_.Validate();
  thread_ = std::thread([this] { Run(); });
}

LiveSession::~LiveSession()
{
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void LiveSession::Add(LiveFrame frame)
{
  {
    const std::lock_guard lock(mutex_);
    if (failure_)
    {
      std::rethrow_exception(failure_);
    }
    if (frames_.size() >= kMostWaitingFrames)
    {
      frames_.pop_front();
      ++state_.dropped;
    }
    frames_.push_back(std::move(frame));
  }
  wake_.notify_all();
}

/// Has the session's thread do the task, and waits for it.
void LiveSession::Ask(const Task& task, std::deque<Task>& queue)
{
  auto done = std::make_shared<std::promise<void>>();
  std::future<void> result = done->get_future();
  {
    const std::lock_guard lock(mutex_);
    if (failure_)
    {
      std::rethrow_exception(failure_);
    }
    queue.push_back(
        [&task, done = std::move(done)](LiveTraining& training)
        {
          try
          {
            task(training);
            done->set_value();
          }
          catch (...)
          {
            done->set_exception(std::current_exception());
          }
        });
  }
  wake_.notify_all();
  try
  {
    result.get();
  }
  catch (const std::future_error&)  // the task was thrown away
  {
    const std::lock_guard lock(mutex_);
    if (failure_)
    {
      std::rethrow_exception(failure_);
    }
    throw Error("Live session: it was stopped.");
  }
}

void LiveSession::Render(const SlicePlane& plane, ViewOutput output, float* image, float* coverage)
{
  Ask([&](LiveTraining& training) { training.Render(plane, output, image, coverage); }, requests_);
}

GaussianField LiveSession::Field()
{
  GaussianField field;
  Ask([&](LiveTraining& training) { field = training.Field(); }, requests_);
  return field;
}

void LiveSession::Wait()
{
  Ask([](LiveTraining&) {}, jobs_);
}

LiveSession::State LiveSession::GetState() const
{
  const std::lock_guard lock(mutex_);
  State state = state_;
  state.waiting = frames_.size();
  return state;
}

LiveResult LiveSession::Finish(double seconds, const ProgressCallback& progress)
{
  LiveResult result;
  Ask(
      [&](LiveTraining& training)
      {
        result = training.Finish(seconds,
                                 [&](const TrainingProgress& now)
                                 {
                                   const bool goOn = Serve(training);
                                   return (!progress || progress(now)) && goOn;
                                 });
        isFinished_ = true;
      },
      jobs_);
  return result;
}

/// Answers what was asked. False when the session is to stop.
bool LiveSession::Serve(LiveTraining& training)
{
  while (true)
  {
    Task request;
    {
      const std::lock_guard lock(mutex_);
      if (requests_.empty())
      {
        return !stop_;
      }
      request = std::move(requests_.front());
      requests_.pop_front();
    }
    request(training);
  }
}

void LiveSession::TakeFrames(LiveTraining& training)
{
  std::deque<LiveFrame> frames;
  {
    const std::lock_guard lock(mutex_);
    frames.swap(frames_);
  }
  State seen;
  for (LiveFrame& frame : frames)
  {
    try
    {
      seen.passedOver += !training.Add(std::move(frame));
    }
    catch (const Error& error)
    {
      ++seen.refused;
      seen.lastError = error.what();
    }
  }
  const std::lock_guard lock(mutex_);
  state_.passedOver += seen.passedOver;
  state_.refused += seen.refused;
  if (seen.refused > 0)
  {
    state_.lastError = seen.lastError;
  }
  state_.frames = training.NumberOfFrames();
  state_.gaussians = training.NumberOfGaussians();
  state_.steps = training.NumberOfSteps();
}

void LiveSession::Run()
{
  try
  {
    const int restAfter = kPassesAtRest * options_.window / options_.batch;
    LiveTraining training(options_);
    training.SetInterlude([&] { Serve(training); });
    int sinceFrame = 0;
    Clock::time_point lastFrame = Clock::now();
    while (true)
    {
      bool hasFrames = false;
      Task job;
      {
        std::unique_lock lock(mutex_);
        const auto hasWork = [&]
        {
          return stop_ || !frames_.empty() || !requests_.empty() || !jobs_.empty() ||
                 (training.HasField() && sinceFrame < restAfter);
        };
        // Not wait(), because it would bind Core to the libstdc++ of GCC 12, which systems that the wheel is for lack.
        while (!wake_.wait_for(lock, std::chrono::minutes(1), hasWork))
        {
        }
        hasFrames = !frames_.empty();
        if (!hasFrames && !jobs_.empty())
        {
          job = std::move(jobs_.front());
          jobs_.pop_front();
        }
      }
      if (!Serve(training))
      {
        break;
      }
      if (job)
      {
        job(training);
        if (isFinished_)
        {
          sinceFrame = restAfter;  // what is finished is left as it is
          isFinished_ = false;
        }
        continue;
      }
      if (hasFrames)
      {
        TakeFrames(training);
        sinceFrame = 0;
        lastFrame = Clock::now();
      }
      else if (Clock::now() - lastFrame > kPause)
      {
        training.SeedWaiting();
      }
      if (sinceFrame < restAfter && training.Step())
      {
        ++sinceFrame;
        const std::lock_guard lock(mutex_);
        state_.gaussians = training.NumberOfGaussians();
        state_.steps = training.NumberOfSteps();
      }
    }
  }
  catch (...)
  {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
  // Nobody waits for what is no longer done: an unanswered task breaks its promise.
  std::deque<Task> unanswered, jobs;
  {
    const std::lock_guard lock(mutex_);
    unanswered.swap(requests_);
    jobs.swap(jobs_);
  }
}

}  // namespace bigus
