// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A field that grows while frames come, trained on a thread of its own.
#include <nanobind/stl/unique_ptr.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <memory>

#include "Arrays.h"
#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Provenance.h"
#include "Live/LiveSession.h"
#include "Progress.h"

namespace bigus
{
namespace
{

/// How often Python hears of a training that runs on the session's thread.
constexpr std::chrono::milliseconds kReport(50);

std::unique_ptr<LiveSession> Start(const std::string& engine, std::uint64_t seed, int window, std::size_t maximumFrames,
                                   std::size_t maximumGaussians, double memoryLimit)
{
  LiveOptions options;
  options.training.engine = engine;
  options.training.seed = seed;
  options.window = window;
  options.maximumFrames = std::max(maximumFrames, static_cast<std::size_t>(std::max(window, 0)));
  options.maximumGaussians = maximumGaussians;
  options.memory = 1e9 * memoryLimit;
  Engine::Create(engine);  // an unknown name is said here and now
  return std::make_unique<LiveSession>(options);
}

void Add(LiveSession& session, const InputBytes& pixels, const InputDoubles& pose, double seconds)
{
  RequireShape(pixels, {-1, -1}, "the frame");
  RequireShape(pose, {4, 4}, "the frame's pose");
  LiveFrame frame;
  frame.width = static_cast<int>(pixels.shape(1));
  frame.height = static_cast<int>(pixels.shape(0));
  frame.pixels.assign(pixels.data(), pixels.data() + pixels.size());
  frame.imageToReference = MatrixAt(pose.data());
  frame.timestamp = seconds;
  const nb::gil_scoped_release others;
  session.Add(std::move(frame));
}

Array Render(LiveSession& session, const Eigen::Matrix4d& pose, int width, int height)
{
  return PictureAt<float>(pose, width, height,
                          [&](const SlicePlane& plane, float* pixels)
                          { session.Render(plane, ViewOutput::Intensity, pixels); });
}

Field Finish(LiveSession& session, double seconds, nb::object function)
{
  PythonProgress progress(std::move(function));
  LiveResult result;
  std::vector<std::string> provenance;
  {
    const nb::gil_scoped_release others;
    // Python is told on the caller's thread, which is the one that hears of Ctrl-C and that VTK's observers expect.
    std::atomic<double> fraction{0};
    std::atomic<bool> stop{false};
    auto finished = std::async(std::launch::async,
                               [&]
                               {
                                 return session.Finish(seconds,
                                                       [&](const TrainingProgress& now)
                                                       {
                                                         fraction = now.fraction;
                                                         return !stop;
                                                       });
                               });
    while (finished.wait_for(kReport) == std::future_status::timeout)
    {
      stop = !progress(fraction.load()) || stop;
    }
    result = finished.get();
    SetProvenanceLine(provenance, "filter", "vtkBigusLiveTrainer");
    AddTrainingProvenance(provenance, result.training, *result.sweep, false);
  }
  progress.Rethrow();
  return {std::move(result.training.field), std::move(provenance), {}};
}

nb::dict StateOf(const LiveSession& session)
{
  const LiveSession::State state = session.GetState();
  return Dict("frames", state.frames, "passed_over", state.passedOver, "dropped", state.dropped, "refused",
              state.refused, "last_error", ToText(state.lastError), "waiting", state.waiting, "gaussians",
              state.gaussians, "steps", state.steps);
}

void Bind(nb::module_& m)
{
  nb::class_<LiveSession>(m, "LiveSession", "Trains on frames, on a thread of its own, from when it is made.")
      .def(nb::new_(&Start), nb::arg("engine"), nb::arg("seed"), nb::arg("window"), nb::arg("maximum_frames"),
           nb::arg("maximum_gaussians"), nb::arg("memory_limit"))
      .def("add", &Add, nb::arg("pixels"), nb::arg("pose"), nb::arg("seconds"))
      .def("wait", &LiveSession::Wait, nb::call_guard<nb::gil_scoped_release>(), "Returns when no frame waits.")
      .def("render", &Render, nb::arg("pose"), nb::arg("width"), nb::arg("height"))
      .def(
          "field",
          [](LiveSession& session) {
            return Field{session.Field(), {}, {}};
          },
          nb::call_guard<nb::gil_scoped_release>(), "The field as it is now.")
      .def("finish", &Finish, nb::arg("seconds"), nb::arg("progress") = nb::none())
      .def("state", &StateOf, "What became of the frames.");
  m.attr("added_filters")["vtkBigusLiveTrainer"] = "live_filters";
}

[[maybe_unused]] const std::size_t row = AddBinding(Bind);

}  // namespace
}  // namespace bigus
