// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One allocation after another fails, by whatever library it is made: Core and IO answer with an error, and no job ends
// its process. Each failure has a process of its own.
//
// BIGUS_ALLOCATIONS=10000 fails each of the first so many allocations of every job; by default 150 of them, spread
// evenly.
#include <execinfo.h>
#include <gtest/gtest.h>
#include <link.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Trainer/Trainer.h"
#include "Data/FieldData.h"
#include "Data/SweepData.h"
#include "Support/Fields.h"
#include "Support/Sweeps.h"
#include "vtkBigusFieldReader.h"
#include "vtkBigusFieldWriter.h"
#include "vtkBigusPoseReader.h"
#include "vtkBigusSequenceReader.h"
#include "vtkBigusSequenceWriter.h"
#include "vtkErrorCode.h"
#include "vtkImageData.h"
#include "vtkNew.h"
#include "vtkObject.h"
#include "vtkPolyData.h"

extern "C"
{
  void* __libc_malloc(std::size_t);
  void* __libc_calloc(std::size_t, std::size_t);
  void* __libc_realloc(void*, std::size_t);
  void* __libc_memalign(std::size_t, std::size_t);
}

namespace
{

using Ranges = std::vector<std::pair<std::uintptr_t, std::uintptr_t>>;

/// Where the code of VTK is, and of what it calls: the standard library, zlib.
Ranges vtk, beneath;

int NoteLibrary(dl_phdr_info* library, std::size_t, void*)
{
  const std::string path = library->dlpi_name, name = path.substr(path.find_last_of('/') + 1);
  const auto begins = [&name](const char* with) { return name.compare(0, std::strlen(with), with) == 0; };
  Ranges* const ranges =
      begins("libvtk") && !begins("libvtkBigus")                                                            ? &vtk
      : begins("libstdc++") || begins("libc.") || begins("libz.") || begins("libexpat") || begins("libtbb") ? &beneath
                                                                                                            : nullptr;
  for (int k = 0; ranges && k < library->dlpi_phnum; ++k)
  {
    const auto begin = library->dlpi_addr + library->dlpi_phdr[k].p_vaddr;
    ranges->emplace_back(begin, begin + library->dlpi_phdr[k].p_memsz);
  }
  return 0;
}

bool IsIn(const Ranges& ranges, const void* code)
{
  const auto address = reinterpret_cast<std::uintptr_t>(code);
  return std::any_of(ranges.begin(), ranges.end(),
                     [address](const auto& range) { return address >= range.first && address < range.second; });
}

/// Whether VTK asks: itself, through what lies beneath it, or through a template of the standard library whose one copy
/// happens to lie in a library of ours.
bool VtkAsks(const void* caller)
{
  void* frames[16];
  const int depth = backtrace(frames, 16);
  int k = static_cast<int>(std::find(frames, frames + depth, caller) - frames);
  while (k < depth && IsIn(beneath, frames[k]))
  {
    ++k;
  }
  return (k < depth && IsIn(vtk, frames[k])) || (k + 1 < depth && IsIn(vtk, frames[k + 1]));
}

/// Allocations that may fail, of this process, while a job runs.
std::atomic<long> made{0};
/// The number of the one that fails; 0: none does.
std::atomic<long> failing{0};
std::atomic<bool> counting{false};
/// Whether jobs use VTK. Its containers do not survive that they lack a block, whoever calls them: they forget that they
/// counted it (vtkFieldData), use it (vtkXMLWriter), or end the process in a destructor. So what VTK asks for does not
/// fail, and all that Core, Data and IO ask for does.
std::atomic<bool> sparesVtk{false};

bool Fails(const void* caller)
{
  if (!counting)
  {
    return false;
  }
  if (sparesVtk)
  {
    counting = false;  // for what looking at the stack allocates
    const bool isSpared = VtkAsks(caller);
    counting = true;
    if (isSpared)
    {
      return false;
    }
  }
  const bool fails = ++made == failing;
  if (fails)
  {
    errno = ENOMEM;
  }
  return fails;
}

void* New(std::size_t size, std::size_t alignment, const void* caller)
{
  void* const block = Fails(caller)   ? nullptr
                      : alignment > 0 ? __libc_memalign(alignment, size)
                                      : __libc_malloc(std::max<std::size_t>(size, 1));
  if (!block)
  {
    throw std::bad_alloc();
  }
  return block;
}

}  // namespace

#define CALLER __builtin_return_address(0)

void* operator new(std::size_t size)
{
  return New(size, 0, CALLER);
}
void* operator new[](std::size_t size)
{
  return New(size, 0, CALLER);
}
void* operator new(std::size_t size, std::align_val_t alignment)
{
  return New(size, static_cast<std::size_t>(alignment), CALLER);
}
void* operator new[](std::size_t size, std::align_val_t alignment)
{
  return New(size, static_cast<std::size_t>(alignment), CALLER);
}

extern "C"
{
  void* malloc(std::size_t size)
  {
    return Fails(CALLER) ? nullptr : __libc_malloc(size);
  }
  void* calloc(std::size_t count, std::size_t size)
  {
    return Fails(CALLER) ? nullptr : __libc_calloc(count, size);
  }
  void* realloc(void* block, std::size_t size)
  {
    return Fails(CALLER) ? nullptr : __libc_realloc(block, size);
  }
  void* memalign(std::size_t alignment, std::size_t size)
  {
    return Fails(CALLER) ? nullptr : __libc_memalign(alignment, size);
  }
  void* aligned_alloc(std::size_t alignment, std::size_t size)
  {
    return Fails(CALLER) ? nullptr : __libc_memalign(alignment, size);
  }
  int posix_memalign(void** block, std::size_t alignment, std::size_t size)
  {
    *block = Fails(CALLER) ? nullptr : __libc_memalign(alignment, size);
    return *block ? 0 : ENOMEM;
  }
}

namespace
{

constexpr int kThreads = 2;

enum Outcome
{
  Done = 10,
  Refused = 11,
  Foreign = 12  ///< an exception that is neither an Error nor want of memory
};

/// Starts TBB's thread, because TBB ends the process when it lacks memory for that.
void StartThread()
{
  std::atomic<int> arrived{0};
  tbb::parallel_for(0, kThreads,
                    [&arrived](int)
                    {
                      ++arrived;
                      while (arrived < kThreads)
                      {
                        std::this_thread::yield();
                      }
                    });
}

/// Runs a job in a process of its own, in which one allocation fails. Returns its wait status, and how many were made.
int RunFailing(const std::function<void()>& job, long which, long& count)
{
  int ends[2];
  if (pipe(ends) != 0)
  {
    return -1;
  }
  const pid_t child = fork();
  if (child == 0)
  {
    int outcome = Done;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, kThreads);
    StartThread();
    made = 0;
    failing = which;
    counting = true;
    try
    {
      job();
    }
    catch (const bigus::Error&)
    {
      outcome = Refused;
    }
    catch (const std::bad_alloc&)
    {
      outcome = Refused;
    }
    catch (const std::exception& error)
    {
      counting = false;
      std::fprintf(stderr, "allocation %ld: %s\n", which, error.what());
      outcome = Foreign;
    }
    counting = false;
    const long all = made;
    [[maybe_unused]] const auto written = write(ends[1], &all, sizeof(all));
    _exit(outcome);
  }
  close(ends[1]);
  if (read(ends[0], &count, sizeof(count)) != sizeof(count))
  {
    count = 0;
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

std::string Describe(int status)
{
  return WIFSIGNALED(status) ? std::string("ended by ") + strsignal(WTERMSIG(status))
                             : "exit code " + std::to_string(WEXITSTATUS(status));
}

/// Does what makes a file in a process of its own, because one that has started threads cannot be forked.
void Prepare(const std::function<void()>& job)
{
  long ignored = 0;
  const int status = RunFailing(job, 0, ignored);
  ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == Done) << Describe(status);
}

/// Every chosen allocation of the job fails once; the job is done all the same, or refused.
void ExpectErrors(const char* name, const std::function<void()>& job)
{
  long all = 0;
  int status = RunFailing(job, 0, all);
  ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == Done) << name << ": " << Describe(status);
  const char* asked = std::getenv("BIGUS_ALLOCATIONS");
  const long most = std::min<long>(all, asked ? std::atol(asked) : all);
  const long step = asked ? 1 : std::max(1l, all / 150);
  long tried = 0, refused = 0, faults = 0;
  for (long which = 1; which <= most; which += step)
  {
    long ignored = 0;
    status = RunFailing(job, which, ignored);
    const bool isSound = WIFEXITED(status) && (WEXITSTATUS(status) == Done || WEXITSTATUS(status) == Refused);
    ++tried;
    refused += isSound && WEXITSTATUS(status) == Refused;
    faults += !isSound;
    EXPECT_TRUE(isSound || faults > 20) << name << ": allocation " << which << " of " << all << ": "
                                        << Describe(status);
  }
  EXPECT_EQ(faults, 0);
  std::printf("%s: %ld allocations, %ld failed one at a time: %ld jobs refused, %ld done all the same, %ld faults\n",
              name, all, tried, refused, tried - refused - faults, faults);
}

/// Frames whose pixels are random, made without a thread.
std::shared_ptr<bigus::Sweep> SmallSweep(int frames, int width, int height)
{
  auto sweep = bigus::test::BlackSweep(frames, width, height, 0.4, 0.4);
  bigus::test::Random random(3);
  for (std::size_t i = 0; i < sweep->PixelsPerFrame() * frames; ++i)
  {
    bigus::test::Pixels(*sweep)[i] = static_cast<float>(random.Uniform(0, 1));
  }
  return sweep;
}

class Allocations : public testing::Test
{
protected:
  void SetUp() override
  {
    vtkObject::GlobalWarningDisplayOff();
    vtk.clear();
    beneath.clear();
    dl_iterate_phdr(NoteLibrary, nullptr);
    void* frame = nullptr;
    backtrace(&frame, 1);    // it loads a library the first time
    bigus::Engine::Names();  // loads the CUDA runtime, which ends the process if it lacks memory while it is loaded
    sparesVtk = false;
    std::string name = (std::filesystem::temp_directory_path() / "bigus-allocations-XXXXXX").string();
    ASSERT_TRUE(mkdtemp(name.data()));
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Path(const char* name) const { return (folder_ / name).string(); }

  std::filesystem::path folder_;
};

TEST_F(Allocations, TrainingWithEverythingOn)
{
  const auto sweep = SmallSweep(9, 24, 20);
  bigus::TrainerOptions options;
  options.automatic = false;
  options.gaussians = 150;
  options.iterations = 8;
  options.virtualPlanes = 1;
  options.interpolation = bigus::FrameInterpolation::Parse("probe+flow");
  options.loss = bigus::Loss::Parse("l1+0.2*dssim+0.1*ffl+contrast");
  options.frameGains = true;
  options.poseSmoothing = 1;
  options.validation = 4;
  options.densification.interval = 2;
  ExpectErrors("training", [&] { bigus::Train(sweep, options); });
}

TEST_F(Allocations, Deciding)
{
  const auto sweep = SmallSweep(9, 16, 14);
  bigus::TrainerOptions options;
  options.iterations = 2;
  options.maximumGaussians = 1000;
  ExpectErrors("deciding", [&] { bigus::Train(sweep, options); });
}

TEST_F(Allocations, Checkpoints)
{
  const auto sweep = SmallSweep(6, 16, 14);
  bigus::TrainerOptions options;
  options.automatic = false;
  options.gaussians = 100;
  options.iterations = 4;
  ExpectErrors("a training that stops and goes on",
               [&]
               {
                 bigus::Checkpoints checkpoints;
                 std::string kept;
                 checkpoints.interval = 0;
                 checkpoints.save = [&kept](const std::string& state) { kept = state; };
                 bigus::Train(sweep, options, nullptr, {}, checkpoints);
                 checkpoints.resume = kept;
                 bigus::Train(sweep, options, nullptr, {}, checkpoints);
               });
}

/// An engine that lacked memory for a slice renders it when there is some.
TEST_F(Allocations, SlicesAgain)
{
  bigus::test::Random random(5);
  const bigus::GaussianField field = bigus::test::RandomField(random, 300, 8.0, 0.7, 2.0, 0.3);
  const bigus::SlicePlane plane = SmallSweep(1, 32, 24)->Plane(0);
  const auto render = [&](bigus::Engine& engine)
  {
    std::vector<float> image(plane.NumberOfPixels());
    engine.Render(plane, bigus::ViewOutput::Intensity, image.data());
    return image;
  };
  ExpectErrors("a slice asked for again",
               [&]
               {
                 const std::unique_ptr<bigus::Engine> engine = bigus::Engine::Create("cpu");
                 engine->SetField(field);
                 try
                 {
                   render(*engine);
                 }
                 catch (const std::bad_alloc&)
                 {
                 }
                 const std::unique_ptr<bigus::Engine> other = bigus::Engine::Create("cpu");
                 other->SetField(field);
                 if (render(*engine) != render(*other))
                 {
                   throw std::logic_error("another slice");
                 }
               });
}

/// Ends the counting before the objects that were made earlier are destroyed: VTK's own destructors and its garbage
/// collector allocate, and a failure there ends the process whoever calls them.
struct UntilHere
{
  ~UntilHere() { counting = false; }
};

/// Updates a reader, writer or filter; its error code is an Error.
template <class Algorithm>
void Require(Algorithm* algorithm)
{
  algorithm->Update();
  if (algorithm->GetErrorCode() != vtkErrorCode::NoError)
  {
    throw bigus::Error("refused");
  }
}

/// A file that was written in spite of a failure is as good as without it.
void RequireSame(const std::string& path, const std::string& truth)
{
  counting = false;
  const auto bytes = [](const std::string& name)
  {
    std::ifstream file(name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  if (bytes(path) != bytes(truth))
  {
    throw std::runtime_error("the file that was written is another");
  }
}

void WriteSequence(const std::shared_ptr<bigus::Sweep>& sweep, const std::string& path)
{
  vtkNew<vtkImageData> image;
  bigus::SweepToImage(*sweep, image);
  vtkNew<vtkBigusSequenceWriter> writer;
  const UntilHere untilHere;
  writer->SetInputData(image);
  writer->SetFileName(path.c_str());
  Require(writer.Get());
}

TEST_F(Allocations, Sequences)
{
  sparesVtk = true;
  const auto sweep = SmallSweep(4, 16, 14);
  const std::string path = Path("s.igs.mha"), again = Path("again.igs.mha");
  Prepare([&] { WriteSequence(sweep, path); });
  ExpectErrors("writing a sequence",
               [&]
               {
                 WriteSequence(sweep, again);
                 RequireSame(again, path);
               });
  ExpectErrors("reading a sequence",
               [&]
               {
                 vtkNew<vtkBigusSequenceReader> reader;
                 const UntilHere untilHere;
                 reader->SetFileName(path.c_str());
                 Require(reader.Get());
               });
}

TEST_F(Allocations, Fields)
{
  sparesVtk = true;
  bigus::test::Random random(4);
  const bigus::GaussianField gaussians = bigus::test::RandomField(random, 40, 5.0, 0.4, 2.0, 0.3);
  for (const char* name : {"f.vtp", "f.ply"})
  {
    const std::string path = Path(name);
    const auto write = [&](const std::string& path)
    {
      vtkNew<vtkPolyData> field;
      vtkNew<vtkBigusFieldWriter> writer;
      const UntilHere untilHere;
      bigus::FieldToPolyData(gaussians, field);  // anew, because VTK notes ranges in what it wrote
      writer->SetInputData(field);
      writer->SetFileName(path.c_str());
      writer->Write();
      if (writer->GetErrorCode() != vtkErrorCode::NoError)
      {
        throw bigus::Error("refused");
      }
    };
    Prepare([&] { write(path); });
    ExpectErrors((std::string("writing ") + name).c_str(),
                 [&]
                 {
                   const std::string again = Path((std::string("again-") + name).c_str());
                   write(again);
                   RequireSame(again, path);
                 });
    ExpectErrors((std::string("reading ") + name).c_str(),
                 [&]
                 {
                   vtkNew<vtkBigusFieldReader> reader;
                   const UntilHere untilHere;
                   reader->SetFileName(path.c_str());
                   Require(reader.Get());
                 });
  }
}

TEST_F(Allocations, Poses)
{
  sparesVtk = true;
  const std::string path = Path("poses.csv");
  {
    std::FILE* file = std::fopen(path.c_str(), "w");
    ASSERT_TRUE(file);
    std::fputs("m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23,m30,m31,m32,m33\n", file);
    for (int k = 0; k < 5; ++k)
    {
      std::fprintf(file, "0.4,0,0,0,0,0.4,0,0,0,0,0.4,%d,0,0,0,1\n", k);
    }
    std::fclose(file);
  }
  ExpectErrors("reading poses",
               [&]
               {
                 vtkNew<vtkBigusPoseReader> reader;
                 const UntilHere untilHere;
                 reader->SetFileName(path.c_str());
                 Require(reader.Get());
               });
}

}  // namespace
