// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/PixelMemory.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <unordered_map>
#include <utility>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr std::size_t kSmall = 1 << 20;                // bytes; a smaller block is not worth a file
constexpr std::chrono::milliseconds kBetweenLooks(1);  // cached pages come at 10 GB/s, so 10 MB in between
constexpr std::uint64_t kWorthWhile = 16;              // pages are let go if files have this part of the limit resident
constexpr double kGigabyte = 1e9;                      // bytes

/// What the environment says, bytes.
std::uint64_t LimitOfEnvironment()
{
  const char* const text = std::getenv("BIGUS_MEMORY");
  if (!text || !*text)
  {
    return 0;
  }
  double gigabytes = -1;
  const char* const end = text + std::strlen(text);
  const auto [rest, error] = std::from_chars(text, end, gigabytes);
  Require(error == std::errc() && rest == end && gigabytes >= 0 && gigabytes <= 1e6,
          "The environment variable BIGUS_MEMORY is '", text,
          "'; it is a number of GB, 0 to 1000000, and 0 sets no limit.");
  return static_cast<std::uint64_t>(gigabytes * kGigabyte);
}

/// Resident bytes of the process, and those of them that are pages of files.
std::optional<std::pair<std::uint64_t, std::uint64_t>> ResidentBytes()
{
  std::FILE* const file = std::fopen("/proc/self/statm", "re");
  unsigned long long size = 0, resident = 0, shared = 0;
  const int found = file ? std::fscanf(file, "%llu %llu %llu", &size, &resident, &shared) : 0;
  if (file)
  {
    std::fclose(file);
  }
  const auto page = static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  return found == 3 ? std::optional(std::pair(resident * page, shared * page)) : std::nullopt;
}

/// All blocks of the process.
class PixelBlocks
{
public:
  /// Never destroyed, because blocks may be freed while the process ends.
  static PixelBlocks& Get()
  {
    static PixelBlocks& blocks = *new PixelBlocks;
    return blocks;
  }

  void Limit(std::uint64_t bytes)
  {
    const std::lock_guard lock(mutex_);
    limit_ = bytes;
  }

  void* New(std::size_t bytes)
  {
    const std::lock_guard lock(mutex_);
    if (!limit_)
    {
      limit_ = LimitOfEnvironment();
    }
    const bool isInFile = *limit_ > 0 && bytes >= kSmall && total_ + bytes > *limit_ / 2;
    if (isInFile && !isWatched_)
    {
      std::thread([this] { Watch(); }).detach();  // waits for the lock
      isWatched_ = true;
    }
    Block block{bytes, isInFile};
    void* const pixels = isInFile ? Map(bytes) : std::calloc(std::max<std::size_t>(bytes, 1), 1);
    if (!pixels)
    {
      throw std::bad_alloc();
    }
    try
    {
      blocks_.emplace(pixels, block);
    }
    catch (...)
    {
      Release(pixels, block);
      throw;
    }
    total_ += bytes;
    inFiles_ += isInFile ? bytes : 0;
    return pixels;
  }

  void Free(void* pixels) noexcept
  {
    const std::lock_guard lock(mutex_);
    const auto found = blocks_.find(pixels);
    if (found == blocks_.end())
    {
      return;
    }
    total_ -= found->second.bytes;
    inFiles_ -= found->second.isInFile ? found->second.bytes : 0;
    Release(pixels, found->second);
    blocks_.erase(found);
  }

  std::uint64_t BytesInFiles()
  {
    const std::lock_guard lock(mutex_);
    return inFiles_;
  }

private:
  struct Block
  {
    std::size_t bytes = 0;
    bool isInFile = false;
  };

  static void Release(void* pixels, const Block& block) noexcept
  {
    if (block.isInFile)
    {
      munmap(pixels, block.bytes);
    }
    else
    {
      std::free(pixels);
    }
  }

  static void* Map(std::size_t bytes)
  {
    const char* const chosen = std::getenv("TMPDIR");
    const std::string folder = chosen && *chosen ? chosen : "/var/tmp";
    const auto fail = [&](const std::string& what, int error)
    {
      throw Error("Pixels larger than the memory limit: " + what + " in the folder " + folder + ": " +
                  std::strerror(error) + ". Set TMPDIR to a folder on a disk with room for " +
                  std::to_string(bytes / 1000000 + 1) + " MB, or raise the limit.");
    };
    std::string name = folder + "/bigus-pixels-XXXXXX";
    const int file = mkostemp(name.data(), O_CLOEXEC);
    if (file < 0)
    {
      fail("no file can be made", errno);
    }
    unlink(name.c_str());
    // All of it is claimed now: a disk that fills up later would end the process.
    if (const int error = posix_fallocate(file, 0, static_cast<off_t>(bytes)); error != 0)
    {
      close(file);
      fail("there is no room", error);
    }
    void* const pixels = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    const int error = errno;
    close(file);
    if (pixels == MAP_FAILED)
    {
      fail("the file cannot be mapped", error);
    }
    return pixels;
  }

  /// Lets pages go while more than the limit is resident. They stay in their file, and come back when they are touched.
  void Watch()
  {
    while (true)
    {
      std::this_thread::sleep_for(kBetweenLooks);
      const std::lock_guard lock(mutex_);
      if (inFiles_ == 0)
      {
        isWatched_ = false;
        return;
      }
      const auto resident = ResidentBytes();
      if (!resident || *limit_ == 0 || resident->first <= *limit_ || resident->second < *limit_ / kWorthWhile)
      {
        continue;
      }
      for (const auto& [pixels, block] : blocks_)
      {
        if (block.isInFile)
        {
          madvise(pixels, block.bytes, MADV_DONTNEED);
        }
      }
    }
  }

  std::mutex mutex_;
  std::optional<std::uint64_t> limit_;  // bytes; not yet asked for
  std::unordered_map<void*, Block> blocks_;
  std::uint64_t total_ = 0, inFiles_ = 0;
  bool isWatched_ = false;
};

}  // namespace

void LimitPixelMemory(std::uint64_t bytes)
{
  PixelBlocks::Get().Limit(bytes);
}

void* NewPixels(std::size_t bytes)
{
  return PixelBlocks::Get().New(bytes);
}

void FreePixels(void* pixels) noexcept
{
  PixelBlocks::Get().Free(pixels);
}

void PrefetchPixels(const void* pixels, std::size_t bytes) noexcept
{
  const std::size_t before =
      reinterpret_cast<std::uintptr_t>(pixels) % static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  auto* const page = const_cast<char*>(static_cast<const char*>(pixels) - before);  // madvise does not write
  madvise(page, bytes + before, MADV_WILLNEED);
}

std::uint64_t PixelBytesInFiles()
{
  return PixelBlocks::Get().BytesInFiles();
}

}  // namespace bigus
