// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Emulator.h"

#include <setjmp.h>
#include <tbb/parallel_for.h>
#include <ucontext.h>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/common_interface_defs.h>
#endif

#include <algorithm>
#include <atomic>
#include <complex>
#include <cstdio>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

thread_local dim3 threadIdx, blockIdx, blockDim, gridDim;

struct EmulatedGraph
{
  std::vector<std::function<void()>> work;
};

/// Does at once what it is given, or records it.
struct EmulatedStream
{
  EmulatedGraph* recording = nullptr;

  void Do(std::function<void()> work)
  {
    if (recording)
    {
      recording->work.push_back(std::move(work));
      return;
    }
    work();
  }
};

namespace bigus
{
namespace emulator
{
namespace
{

constexpr int kLanes = 32;
constexpr std::size_t kStack = 256 << 10;

/// A stack and where it stopped.
class Stack
{
public:
  /// The one that runs already.
  Stack() = default;
  Stack(const Stack&) = delete;
  Stack& operator=(const Stack&) = delete;

  /// A new one, on which `body` is to run. It never returns.
  void Prepare(void (*body)())
  {
    memory_.reset(new char[kStack]);
    getcontext(&context_);
    context_.uc_stack.ss_sp = memory_.get();
    context_.uc_stack.ss_size = kStack;
    context_.uc_link = nullptr;
    makecontext(&context_, body, 0);
    isNew_ = true;
  }
  bool IsPrepared() const { return memory_ != nullptr; }

  /// Stops this one and goes on with another.
  void SwitchTo(Stack& other)
  {
#if defined(__SANITIZE_ADDRESS__)
    // The sanitizer watches device memory and stacks of kernels like any other, if it is told which stack runs.
    void* fake = nullptr;
    other.caller_ = this;
    __sanitizer_start_switch_fiber(&fake, other.memory_ ? other.memory_.get() : other.bottom_,
                                   other.memory_ ? kStack : other.size_);
    swapcontext(&context_, &other.context_);
    Arrive(fake);
#else
    // Many times faster than swapcontext, which asks the system for the mask of signals.
    if (_setjmp(point_) == 0)
    {
      if (!other.isNew_)
      {
        _longjmp(other.point_, 1);
      }
      other.isNew_ = false;
      setcontext(&other.context_);
    }
#endif
  }

  /// To be called first on a new stack.
  void Arrive(void* fake = nullptr)
  {
#if defined(__SANITIZE_ADDRESS__)
    const void* bottom;
    std::size_t size;
    __sanitizer_finish_switch_fiber(fake, &bottom, &size);
    if (caller_ && !caller_->memory_)
    {
      caller_->bottom_ = bottom;
      caller_->size_ = size;
    }
#else
    static_cast<void>(fake);
#endif
  }

private:
  std::unique_ptr<char[]> memory_;
  ucontext_t context_;
  jmp_buf point_;
  bool isNew_ = false;
  Stack* caller_ = nullptr;
  const void* bottom_ = nullptr;
  std::size_t size_ = 0;
};

/// A thread of a block, on its own stack. It is started once and then waits for the next kernel.
struct Fibre
{
  Stack stack;
  bool finished = true;
  enum
  {
    Ready,
    AtExchange,
    AtBarrier
  } state = Ready;
  unsigned int generation = 0;  // of the exchange or barrier waited for
};

struct Warp
{
  int lanes = 0, arrived = 0;
  unsigned int generation = 0;
  std::uint64_t values[2][kLanes];  // of this exchange and the one before, which lanes may still read
};

/// What one thread of the CPU runs thread blocks with.
class Machine
{
public:
  void RunBlock(int threads, const std::function<void()>& kernel)
  {
    kernel_ = &kernel;
    if (fibres_.size() < static_cast<std::size_t>(threads))
    {
      fibres_.resize(threads);
    }
    threads_ = running_ = threads;
    arrived_ = 0;
    any_[0] = any_[1] = false;
    warps_.assign((threads + kLanes - 1) / kLanes, Warp());
    for (int i = 0; i < threads; ++i)
    {
      fibres_[i].finished = false;
      fibres_[i].state = Fibre::Ready;
      ++warps_[i / kLanes].lanes;
    }
    for (unsigned int pass = blockIdx.x; running_ > 0; ++pass)
    {
      bool progress = false;
      for (std::size_t k = 0; k < warps_.size(); ++k)
      {
        const std::size_t warp = (k + pass) % warps_.size();
        while (RunWarp(static_cast<int>(warp), pass % 2 == 1))
        {
          progress = true;
        }
      }
      if (!progress && running_ > 0)
      {
        std::fprintf(stderr,
                     "CUDA emulator: deadlock. Some threads of a warp or block wait for others that have returned or "
                     "wait elsewhere.\n");
        std::abort();
      }
    }
  }

  const std::uint64_t* Exchange(std::uint64_t value)
  {
    Warp& warp = warps_[threadIdx.x / kLanes];
    std::uint64_t* values = warp.values[warp.generation % 2];
    values[threadIdx.x % kLanes] = value;
    Wait(Fibre::AtExchange, warp.lanes, warp.arrived, warp.generation);
    return values;
  }

  bool Barrier(bool value)
  {
    const unsigned int turn = generation_ % 2;
    any_[turn] = any_[turn] || value;
    if (arrived_ + 1 == threads_)
    {
      any_[1 - turn] = false;
    }
    Wait(Fibre::AtBarrier, threads_, arrived_, generation_);
    return any_[turn];
  }

private:
  /// Goes on when all have arrived.
  template <class State>
  void Wait(State state, int all, int& arrived, unsigned int& generation)
  {
    if (++arrived == all)
    {
      arrived = 0;
      ++generation;
      return;
    }
    Fibre& fibre = fibres_[threadIdx.x];
    fibre.state = state;
    fibre.generation = generation;
    fibre.stack.SwitchTo(scheduler_);
  }

  bool IsReady(const Fibre& fibre, const Warp& warp) const
  {
    return !fibre.finished && (fibre.state == Fibre::Ready ||
                               fibre.generation != (fibre.state == Fibre::AtExchange ? warp.generation : generation_));
  }

  /// Runs every lane that can run. Returns whether any could.
  bool RunWarp(int warp, bool backwards)
  {
    bool ran = false;
    for (int k = 0; k < kLanes; ++k)
    {
      const int i = warp * kLanes + (backwards ? kLanes - 1 - k : k);
      if (i < threads_ && IsReady(fibres_[i], warps_[warp]))
      {
        fibres_[i].state = Fibre::Ready;
        Resume(i);
        ran = true;
      }
    }
    return ran;
  }

  void Resume(int i)
  {
    threadIdx.x = i;
    Fibre& fibre = fibres_[i];
    if (!fibre.stack.IsPrepared())
    {
      fibre.stack.Prepare(&Machine::Body);
    }
    scheduler_.SwitchTo(fibre.stack);  // until it waits or has finished
  }

  static void Body();

  std::deque<Fibre> fibres_;  // which grow and do not move: their stacks hold references
  std::vector<Warp> warps_;
  const std::function<void()>* kernel_ = nullptr;
  Stack scheduler_;
  int threads_ = 0, running_ = 0, arrived_ = 0;
  unsigned int generation_ = 0;
  bool any_[2];
};

Machine& ThisMachine()
{
  static thread_local Machine machine;
  return machine;
}

/// For ever: a kernel for this thread, then rest.
void Machine::Body()
{
  Machine& machine = ThisMachine();
  machine.fibres_[threadIdx.x].stack.Arrive();
  while (true)
  {
    Fibre& fibre = machine.fibres_[threadIdx.x];
    (*machine.kernel_)();
    fibre.finished = true;
    --machine.running_;
    fibre.stack.SwitchTo(machine.scheduler_);
  }
}

struct Memory
{
  std::mutex mutex;
  std::map<void*, std::size_t> blocks;
  std::size_t used = 0, total = std::size_t(8) << 30;
};
Memory& TheMemory()
{
  static Memory* memory = new Memory;  // outlives what static objects free
  return *memory;
}

}  // namespace

void Run(dim3 grid, int threads, cudaStream_t stream, std::function<void()> kernel)
{
  stream->Do(
      [grid, threads, kernel = std::move(kernel)]
      {
        tbb::parallel_for(std::size_t(0), std::size_t(grid.x) * grid.y,
                          [&](std::size_t block)
                          {
                            gridDim = grid;
                            blockDim = dim3(threads);
                            blockIdx = dim3(static_cast<unsigned int>(block % grid.x),
                                            static_cast<unsigned int>(block / grid.x));
                            ThisMachine().RunBlock(threads, kernel);
                          });
      });
}

const std::uint64_t* Exchange(std::uint64_t value)
{
  return ThisMachine().Exchange(value);
}

bool Barrier(bool value)
{
  return ThisMachine().Barrier(value);
}

// ---- cuFFT, by its definition

namespace
{

struct Plan
{
  int height, width, batch;
};
std::vector<Plan>& Plans()
{
  static std::vector<Plan> plans;
  return plans;
}
bool theFourier = true;

using Complex = std::complex<double>;

/// out_k = sum_j in_j exp(sign 2 pi i j k / n), numbers `step` apart.
void Transform(Complex* values, int n, int step, int sign)
{
  std::vector<Complex> out(n);
  for (int k = 0; k < n; ++k)
  {
    for (int j = 0; j < n; ++j)
    {
      const double angle = sign * 2 * M_PI * (static_cast<std::int64_t>(j) * k % n) / n;
      out[k] += values[j * step] * Complex(std::cos(angle), std::sin(angle));
    }
  }
  for (int k = 0; k < n; ++k)
  {
    values[k * step] = out[k];
  }
}

void TransformImage(std::vector<Complex>& image, const Plan& plan, int sign)
{
  for (int row = 0; row < plan.height; ++row)
  {
    Transform(image.data() + row * plan.width, plan.width, 1, sign);
  }
  for (int column = 0; column < plan.width; ++column)
  {
    Transform(image.data() + column, plan.height, plan.width, sign);
  }
}

}  // namespace

int PlanMany(int* plan, int, int* size, int*, int, int, int*, int, int, int, int batch)
{
  *plan = static_cast<int>(Plans().size());
  Plans().push_back({size[0], size[1], batch});
  return 0;
}

int SetStream(int, cudaStream_t)
{
  return 0;
}

int RealToComplex(int index, float* in, float* out)
{
  const Plan plan = Plans()[index];
  const int columns = plan.width / 2 + 1;
  for (int b = 0; b < plan.batch; ++b)
  {
    std::vector<Complex> image(in, in + plan.width * plan.height);
    TransformImage(image, plan, -1);
    for (int k = 0; k < columns * plan.height; ++k)
    {
      const Complex value = image[k / columns * plan.width + k % columns];
      *out++ = static_cast<float>(value.real());
      *out++ = static_cast<float>(value.imag());
    }
    in += plan.width * plan.height;
  }
  return 0;
}

int ComplexToReal(int index, float* in, float* out)
{
  const Plan plan = Plans()[index];
  const int columns = plan.width / 2 + 1;
  for (int b = 0; b < plan.batch; ++b)
  {
    std::vector<Complex> image(plan.width * plan.height);
    for (int row = 0; row < plan.height; ++row)
    {
      for (int column = 0; column < plan.width; ++column)
      {
        const bool held = column < columns;
        const int k = held ? row * columns + column : (plan.height - row) % plan.height * columns + plan.width - column;
        image[row * plan.width + column] = Complex(in[2 * k], held ? in[2 * k + 1] : -in[2 * k + 1]);
      }
    }
    TransformImage(image, plan, 1);
    for (const Complex& value : image)
    {
      *out++ = static_cast<float>(value.real());
    }
    in += 2 * columns * plan.height;
  }
  return 0;
}

int Destroy(int)
{
  return 0;
}

bool HasFourier()
{
  return theFourier;
}

void SetHasFourier(bool has)
{
  theFourier = has;
}

void SetMemory(std::size_t bytes)
{
  TheMemory().total = bytes;
}

std::size_t MemoryUsed()
{
  return TheMemory().used;
}

}  // namespace emulator
}  // namespace bigus

using bigus::emulator::TheMemory;

cudaError_t cudaMalloc(void** memory, std::size_t bytes)
{
  bigus::emulator::Memory& all = TheMemory();
  const std::lock_guard<std::mutex> lock(all.mutex);
  *memory = nullptr;
  if (bytes > all.total - std::min(all.used, all.total))
  {
    return cudaErrorMemoryAllocation;
  }
  *memory = std::aligned_alloc(256, (bytes + 255) / 256 * 256);
  if (!*memory)
  {
    return cudaErrorMemoryAllocation;
  }
  std::memset(*memory, 0xff, bytes);  // NaN: what is read before it is written shows
  all.blocks[*memory] = bytes;
  all.used += bytes;
  return cudaSuccess;
}

cudaError_t cudaFree(void* memory)
{
  bigus::emulator::Memory& all = TheMemory();
  const std::lock_guard<std::mutex> lock(all.mutex);
  const auto found = all.blocks.find(memory);
  if (found != all.blocks.end())
  {
    all.used -= found->second;
    all.blocks.erase(found);
    std::free(memory);
  }
  return cudaSuccess;
}

cudaError_t cudaMemGetInfo(std::size_t* free, std::size_t* total)
{
  *total = TheMemory().total;
  *free = *total - std::min(TheMemory().used, *total);
  return cudaSuccess;
}

cudaError_t cudaGetDeviceProperties(cudaDeviceProp* properties, int)
{
  *properties = {};
  std::strncpy(properties->name, "emulated on the CPU", sizeof(properties->name) - 1);
  properties->totalGlobalMem = TheMemory().total;
  return cudaSuccess;
}

cudaError_t cudaStreamCreate(cudaStream_t* stream)
{
  *stream = new EmulatedStream;
  return cudaSuccess;
}

cudaError_t cudaStreamDestroy(cudaStream_t stream)
{
  delete stream;
  return cudaSuccess;
}

cudaError_t cudaStreamSynchronize(cudaStream_t stream)
{
  return stream->recording ? cudaErrorStreamCaptureUnsupported : cudaSuccess;
}

cudaError_t cudaMemcpyAsync(void* to, const void* from, std::size_t bytes, cudaMemcpyKind, cudaStream_t stream)
{
  stream->Do([=] { std::memmove(to, from, bytes); });
  return cudaSuccess;
}

cudaError_t cudaMemsetAsync(void* to, int value, std::size_t bytes, cudaStream_t stream)
{
  stream->Do([=] { std::memset(to, value, bytes); });
  return cudaSuccess;
}

cudaError_t cudaStreamBeginCapture(cudaStream_t stream, cudaStreamCaptureMode)
{
  stream->recording = new EmulatedGraph;
  return cudaSuccess;
}

cudaError_t cudaStreamEndCapture(cudaStream_t stream, cudaGraph_t* graph)
{
  *graph = stream->recording;
  stream->recording = nullptr;
  return cudaSuccess;
}

cudaError_t cudaGraphInstantiate(cudaGraphExec_t* executable, cudaGraph_t graph, unsigned long long)
{
  *executable = new EmulatedGraph(*graph);
  return cudaSuccess;
}

cudaError_t cudaGraphLaunch(cudaGraphExec_t executable, cudaStream_t stream)
{
  for (const std::function<void()>& work : executable->work)
  {
    stream->Do(work);
  }
  return cudaSuccess;
}

cudaError_t cudaGraphDestroy(cudaGraph_t graph)
{
  delete graph;
  return cudaSuccess;
}

cudaError_t cudaGraphExecDestroy(cudaGraphExec_t executable)
{
  delete executable;
  return cudaSuccess;
}
