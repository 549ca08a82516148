// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One process that reads, trains, is interrupted, resumes, slices and writes for as long as it is told to, and watches
// its memory. Fails where a field differs from the first one, or where memory grows.
//
//     bigusSoak [minutes, default 60] [line of the log every so many seconds, default 30]
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Core/Trainer/Trainer.h"
#include "Support/Random.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkBigusPhantomSource.h"
#include "vtkBigusReslice.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusSequenceWriter.h"
#include "vtkBigusTrainer.h"
#include "vtkCommand.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkPolyData.h"

namespace
{

void Require(bool isSound, const char* what)
{
  if (!isSound)
  {
    throw bigus::Error(what);
  }
}

/// MB that are in memory, less what the allocator keeps for later.
double ResidentMegabytes()
{
  malloc_trim(0);
  long all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return 1e-6 * static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

std::string Bytes(const std::string& path)
{
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

/// Trains until `reports` calls of progress, or to the end where that is 0; from a state, where there is one. Returns
/// whether it is finished, and writes the field.
bool Train(vtkImageData* sweep, int reports, std::string& state, const std::string& path)
{
  vtkNew<vtkBigusTrainer> trainer;
  trainer->SetInputData(sweep);
  trainer->SetMaximumGaussians(3000);
  trainer->SetIterations(60);
  trainer->SetDensificationInterval(10);
  trainer->SetValidation(5);
  bigus::Checkpoints checkpoints;
  checkpoints.interval = 0.05;
  checkpoints.save = [&state](const std::string& bytes) { state = bytes; };
  checkpoints.resume = state;
  trainer->SetCheckpoints(checkpoints);
  int seen = 0;
  struct Stop : vtkCommand
  {
    static Stop* New() { return new Stop; }
    void Execute(vtkObject* caller, unsigned long, void*) override
    {
      if (++*seen == reports)
      {
        static_cast<vtkAlgorithm*>(caller)->SetAbortExecute(1);
      }
    }
    int* seen = nullptr;
    int reports = 0;
  };
  vtkNew<Stop> stop;
  stop->seen = &seen;
  stop->reports = reports;
  trainer->AddObserver(vtkCommand::ProgressEvent, stop);
  trainer->Update();
  Require(trainer->GetErrorCode() == vtkErrorCode::NoError, "training failed");
  vtkNew<vtkBigusFieldWriter> writer;
  writer->SetInputData(trainer->GetOutput());
  writer->SetFileName(path.c_str());
  Require(writer->Write() == 1 && writer->GetErrorCode() == vtkErrorCode::NoError, "a field was not written");
  return trainer->GetFinished();
}

void Slice(const std::string& path, bigus::test::Random& random)
{
  vtkNew<vtkBigusFieldReader> reader;
  reader->SetFileName(path.c_str());
  vtkNew<vtkBigusReslice> reslice;
  reslice->SetInputConnection(reader->GetOutputPort());
  reslice->SetResliceAxesOrigin(random.Uniform(-5, 5), random.Uniform(-5, 5), random.Uniform(10, 30));
  reslice->SetOutputExtent(0, 199, 0, 149, 0, 0);
  reslice->SetOutputSpacing(0.2, 0.2, 0.2);
  reslice->Update();
  Require(reslice->GetErrorCode() == vtkErrorCode::NoError, "slicing failed");
}

int Soak(double minutes, double every, const std::string& folder)
{
  const std::string sequence = folder + "/sweep.igs.mha", field = folder + "/field.vtp";
  {
    vtkNew<vtkBigusPhantomSource> phantom;
    phantom->SetNumberOfFrames(16);
    phantom->SetFrameSize(64, 64);
    phantom->SetPixelSize(0.5);
    vtkNew<vtkBigusSequenceWriter> writer;
    writer->SetInputConnection(phantom->GetOutputPort());
    writer->SetFileName(sequence.c_str());
    Require(writer->Write() == 1, "the phantom was not written");
  }
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [start]
  { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  bigus::test::Random random(1);
  std::string truth;
  std::vector<double> times, megabytes;
  int cycles = 0, stops = 0;
  double told = 0;
  while (seconds() < 60 * minutes)
  {
    vtkNew<vtkBigusSequenceReader> reader;
    reader->SetFileName(sequence.c_str());
    reader->Update();
    Require(reader->GetErrorCode() == vtkErrorCode::NoError, "the sequence was not read");
    std::string state;
    const bool stopsAtAll = cycles > 0;
    while (!Train(reader->GetOutput(), stopsAtAll ? static_cast<int>(random.Uniform(60, 400)) : 0, state, field))
    {
      ++stops;
      Slice(field, random);
    }
    truth = truth.empty() ? Bytes(field) : truth;
    Require(Bytes(field) == truth, "a resumed training ended with another field");
    Slice(field, random);
    ++cycles;
    times.push_back(seconds());
    megabytes.push_back(ResidentMegabytes());
    if (times.back() - told > every)
    {
      told = times.back();
      std::printf("%6.0f s  %5d cycles  %6d stops  %7.1f MB\n", told, cycles, stops, megabytes.back());
      std::fflush(stdout);
    }
  }
  // The first fifth fills caches.
  const std::size_t first = times.size() / 5;
  double n = 0, meanTime = 0, meanMemory = 0, product = 0, square = 0;
  for (std::size_t k = first; k < times.size(); ++k, ++n)
  {
    meanTime += times[k];
    meanMemory += megabytes[k];
  }
  meanTime /= n;
  meanMemory /= n;
  for (std::size_t k = first; k < times.size(); ++k)
  {
    product += (times[k] - meanTime) * (megabytes[k] - meanMemory);
    square += (times[k] - meanTime) * (times[k] - meanTime);
  }
  const double slope = square > 0 ? product / square * 3600 : 0;
  const auto [least, most] =
      std::minmax_element(megabytes.begin() + static_cast<std::ptrdiff_t>(first), megabytes.end());
  std::printf(
      "%d cycles, %d stops, every field the same; after the first fifth %.1f to %.1f MB, slope %+.2f MB an hour\n",
      cycles, stops, *least, *most, slope);
  constexpr double kMostGrowth = 0.05;  // of the memory, over the run
  return slope / 60 * minutes > kMostGrowth * meanMemory ? 1 : 0;
}

}  // namespace

int main(int argumentCount, char** arguments)
{
  const double minutes = argumentCount > 1 ? std::atof(arguments[1]) : 60;
  const double every = argumentCount > 2 ? std::atof(arguments[2]) : 30;
  std::string folder = (std::filesystem::temp_directory_path() / "bigus-soak-XXXXXX").string();
  if (!mkdtemp(folder.data()))
  {
    return 2;
  }
  int code = 2;
  try
  {
    code = Soak(minutes, every, folder);
  }
  catch (const std::exception& error)
  {
    std::fprintf(stderr, "%s\n", error.what());
  }
  std::filesystem::remove_all(folder);
  return code;
}
