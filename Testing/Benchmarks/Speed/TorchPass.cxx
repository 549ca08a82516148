// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "TorchPass.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "BenchTorchScript.h"
#include "Core/Model/Error.h"
#include "Exit.h"

extern char** environ;

namespace bigus::bench
{

namespace
{

/// A file that goes away with the object.
class TemporaryFile
{
public:
  TemporaryFile()
  {
    std::error_code fault;
    const std::string folder = std::filesystem::temp_directory_path(fault).string();
    path_ = folder + "/bigus-bench-XXXXXX";
    const int file = fault ? -1 : mkstemp(path_.data());
    if (file < 0)
    {
      throw Error("No temporary file can be made in '" + folder +
                  "'. Let TMPDIR name a folder that can be written to.");
    }
    close(file);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() { unlink(path_.c_str()); }
  const std::string& Path() const { return path_; }

private:
  std::string path_;
};

template <class T>
void Put(std::ofstream& file, const std::vector<T>& values)
{
  file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
}

void PutVector(std::vector<float>& out, const Eigen::Ref<const Eigen::VectorXd>& values)
{
  for (double value : values)
  {
    out.push_back(static_cast<float>(value));
  }
}

/// As bench_torch.py reads it.
void WriteWorkload(const TrainingPass& pass, const std::string& path)
{
  const GaussianField& field = pass.field;
  const Sweep& sweep = *pass.sweep;
  std::ofstream file(path, std::ios::binary);
  Put<std::int64_t>(file, {std::int64_t(field.Size()), sweep.NumberOfFrames(), sweep.width, sweep.height,
                           std::int64_t(pass.batches.front().size())});
  Put<double>(file, {field.transfer.gamma, field.beam.elevationSigma, pass.accuracy.tolerance / field.transfer.gamma,
                     pass.rates.mean, pass.rates.logScale,
                     0.5 * pass.rates.rotation,  // a turn by omega changes the quaternion by omega / 2
                     pass.rates.reflectivity});
  std::vector<float> means, scales, rotations, reflectivities, planes;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    PutVector(means, field.means[i]);
    PutVector(scales, field.scales[i].array().log().matrix());
    PutVector(rotations, field.rotations[i]);
    reflectivities.push_back(static_cast<float>(field.reflectivities[i]));
  }
  for (int frame = 0; frame < sweep.NumberOfFrames(); ++frame)
  {
    const SlicePlane plane = sweep.Plane(frame);
    PutVector(planes, plane.origin);
    PutVector(planes, plane.columnStep);
    PutVector(planes, plane.rowStep);
  }
  for (const std::vector<float>& values : {means, scales, rotations, reflectivities, planes})
  {
    Put(file, values);
  }
  for (const std::vector<int>& batch : pass.batches)
  {
    Put(file, std::vector<std::int64_t>(batch.begin(), batch.end()));
  }
  file.write(static_cast<const char*>(sweep.pixels.get()),
             static_cast<std::streamsize>(sweep.PixelsPerFrame() * sweep.NumberOfFrames()));
  if (!file.flush())
  {
    throw Error("The temporary file " + path + " could not be written.");
  }
}

/// Runs a program that reads `input` and puts what it prints into `output`; its stderr goes nowhere. Returns
/// its exit status, or -1 if it cannot be started. Throws Interrupted, with the program ended.
int RunProgram(const std::vector<std::string>& arguments, const std::string& input, std::string& output)
{
  int toChild[2], fromChild[2];
  if (pipe2(toChild, O_CLOEXEC) != 0)
  {
    return -1;
  }
  if (pipe2(fromChild, O_CLOEXEC) != 0)
  {
    close(toChild[0]);
    close(toChild[1]);
    return -1;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, toChild[0], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fromChild[1], STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::vector<char*> names;
  for (const std::string& argument : arguments)
  {
    names.push_back(const_cast<char*>(argument.c_str()));
  }
  names.push_back(nullptr);
  pid_t child = -1;
  const int fault = posix_spawnp(&child, names[0], &actions, nullptr, names.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(toChild[0]);
  close(fromChild[1]);
  if (fault != 0)
  {
    close(toChild[1]);
    close(fromChild[0]);
    return -1;
  }

  // A child that ends early must not end this program with it.
  const auto before = signal(SIGPIPE, SIG_IGN);
  std::size_t written = 0;
  while (written < input.size())
  {
    const ssize_t count = write(toChild[1], input.data() + written, input.size() - written);
    if (count <= 0)
    {
      break;
    }
    written += static_cast<std::size_t>(count);
  }
  close(toChild[1]);
  signal(SIGPIPE, before);

  char buffer[4096];
  for (;;)
  {
    pollfd ready{fromChild[0], POLLIN, 0};
    if (command::IsInterrupted())
    {
      kill(child, SIGTERM);
    }
    if (poll(&ready, 1, 100) <= 0)
    {
      continue;
    }
    const ssize_t count = read(fromChild[0], buffer, sizeof buffer);
    if (count <= 0)
    {
      break;
    }
    output.append(buffer, static_cast<std::size_t>(count));
  }
  close(fromChild[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR)
  {
  }
  if (command::IsInterrupted())
  {
    throw command::Interrupted();
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// Python puts neither the working directory nor folders of the environment on its path, so that nobody's torch.py runs.
constexpr const char* kIsolated = "-I";

/// The first Python that can import PyTorch, or nothing.
std::string FindPython()
{
  for (const char* python : {"python3", "/usr/bin/python3"})
  {
    std::string output;
    if (RunProgram({python, kIsolated, "-c", "import numpy, torch"}, "", output) == 0)
    {
      return python;
    }
  }
  return {};
}

}  // namespace

TorchResult RunTorchPass(const TrainingPass& pass, int repeats, int threads)
{
  TorchResult result;
  const std::string python = FindPython();
  if (python.empty())
  {
    result.missing = "neither python3 nor /usr/bin/python3 can import torch";
    return result;
  }
  const TemporaryFile workload;
  WriteWorkload(pass, workload.Path());
  std::string output;
  const int status =
      RunProgram({python, kIsolated, "-", workload.Path(), std::to_string(repeats), std::to_string(threads)},
                 kBenchTorchScript, output);
  const nlohmann::json answer = nlohmann::json::parse(output, nullptr, false);
  if (status != 0 || !answer.is_object())
  {
    throw Error("The training pass in PyTorch failed (" + python + ", exit status " + std::to_string(status) +
                "). Run Testing/Benchmarks/Speed/bench_torch.py by hand to see why.");
  }
  result.version = answer.at("torch");
  result.losses = answer.at("losses").get<std::vector<double>>();
  result.seconds = answer.at("seconds").get<std::vector<double>>();
  return result;
}

}  // namespace bigus::bench
