// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Memory for the pixels of sweeps, which may be larger than the machine's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

namespace bigus
{

/// How much memory the process should keep resident, bytes; 0 (the default): no limit, and all pixels lie in memory. With
/// a limit, blocks of pixels that bring all blocks together above half of it lie in nameless files in the folder $TMPDIR,
/// or else /var/tmp, and their pages are let go whenever more than the limit is resident. The limit holds for blocks that
/// are made afterwards, and for the whole process. Without a call the environment variable BIGUS_MEMORY decides, in GB
/// (10^9 bytes). What is trained is the same, bit for bit.
void LimitPixelMemory(std::uint64_t bytes);

/// `bytes` that are 0, for FreePixels. Throws Error where a file is needed and the folder has no room, and std::bad_alloc.
void* NewPixels(std::size_t bytes);
void FreePixels(void* pixels) noexcept;

/// The same with an owner.
template <class Pixel>
std::shared_ptr<Pixel> AllocatePixels(std::size_t count)
{
  return std::shared_ptr<Pixel>(static_cast<Pixel*>(NewPixels(count * sizeof(Pixel))), FreePixels);
}

/// Begins to fetch pixels that lie in a file and will be read soon; of others nothing happens.
void PrefetchPixels(const void* pixels, std::size_t bytes) noexcept;

/// Bytes of the blocks that lie in files.
std::uint64_t PixelBytesInFiles();

}  // namespace bigus
