// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// https://www.w3.org/TR/png
#include "IO/Formats/PngFile.h"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "IO/FileError.h"
#include "IO/Text.h"
#include "vtk_zlib.h"

namespace bigus
{
namespace
{

std::uint32_t BigEndian(const unsigned char* bytes)
{
  return std::uint32_t(bytes[0]) << 24 | std::uint32_t(bytes[1]) << 16 | std::uint32_t(bytes[2]) << 8 | bytes[3];
}

FileError Damaged(const std::string& fileName)
{
  return FormatError(fileName + ": the PNG image is damaged or truncated");
}

// Signature and IHDR chunk; leaves the file behind them.
PngHeader ReadHeader(InputFile& input)
{
  const unsigned char signature[16] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
  unsigned char bytes[33] = {};  // ... width, height, depth, colour, compression, filter, interlace, checksum
  if (input.Read(bytes, sizeof(bytes)) != sizeof(bytes) || std::memcmp(bytes, signature, sizeof(signature)) != 0)
  {
    throw FormatError(input.Name() + ": not a PNG image, or truncated");
  }
  const std::uint32_t width = BigEndian(bytes + 16);
  const std::uint32_t height = BigEndian(bytes + 20);
  const int depth = bytes[24];
  const std::string size = std::to_string(width) + " x " + std::to_string(height);
  if (width < 1 || height < 1 || width > largestSide || height > largestSide)
  {
    throw FormatError(input.Name() + ": claims " + size + " pixels; 1 to " + std::to_string(largestSide) +
                      " a side are read");
  }
  if (bytes[25] != 0 || (depth != 8 && depth != 16) || bytes[28] != 0)
  {
    throw FormatError(input.Name() + ": not a grey image of 8 or 16 bits without interlacing (PNG colour type " +
                      std::to_string(bytes[25]) + ", depth " + std::to_string(depth) + ", interlacing " +
                      std::to_string(bytes[28]) + "); convert it to one");
  }
  if (std::uint64_t(width) * height * std::uint64_t(depth / 8) / deflateLimit > input.Size())
  {
    throw TruncationError(input.Name() + ": claims " + size + " pixels, more than its " + std::to_string(input.Size()) +
                          " bytes can hold");
  }
  return {static_cast<int>(width), static_cast<int>(height), depth == 8 ? ElementType::UInt8 : ElementType::UInt16};
}

// Inflates all IDAT chunks into `data`, which must come out exactly full.
void InflateChunks(InputFile& input, std::vector<unsigned char>& data)
{
  z_stream zlib = {};
  if (inflateInit(&zlib) != Z_OK)
  {
    throw FileError(vtkErrorCode::UnknownError, input.Name() + ": zlib cannot be started");
  }
  const struct Ender
  {
    z_stream& zlib;
    ~Ender() { inflateEnd(&zlib); }
  } ender{zlib};

  unsigned char overflow = 0;  // takes a byte too many, so that it is noticed
  zlib.next_out = data.data();
  zlib.avail_out = static_cast<uInt>(data.size());
  std::vector<unsigned char> chunk;
  bool ended = false;
  for (;;)
  {
    unsigned char head[8];
    if (input.Read(head, 8) != 8 || BigEndian(head) > input.Remaining())
    {
      throw Damaged(input.Name());
    }
    chunk.resize(BigEndian(head));
    unsigned char checksum[4];
    if (input.Read(chunk.data(), chunk.size()) != chunk.size() || input.Read(checksum, 4) != 4)
    {
      throw Damaged(input.Name());
    }
    uLong computed = crc32(crc32(0, nullptr, 0), head + 4, 4);
    computed = chunk.empty() ? computed : crc32(computed, chunk.data(), static_cast<uInt>(chunk.size()));
    if (computed != BigEndian(checksum))
    {
      throw Damaged(input.Name());
    }
    if (std::memcmp(head + 4, "IEND", 4) == 0)
    {
      break;
    }
    if (std::memcmp(head + 4, "IDAT", 4) != 0)
    {
      continue;
    }
    zlib.next_in = chunk.data();
    zlib.avail_in = static_cast<uInt>(chunk.size());
    while (zlib.avail_in > 0 && !ended)
    {
      if (zlib.avail_out == 0)
      {
        zlib.next_out = &overflow;
        zlib.avail_out = 1;
      }
      const int result = inflate(&zlib, Z_NO_FLUSH);
      ended = result == Z_STREAM_END;
      if ((result != Z_OK && !ended) || zlib.total_out > data.size())
      {
        throw Damaged(input.Name());
      }
    }
  }
  if (!ended || zlib.total_out != data.size())
  {
    throw Damaged(input.Name());
  }
}

unsigned char Paeth(int left, int up, int upLeft)
{
  const int estimate = left + up - upLeft;
  const int toLeft = std::abs(estimate - left);
  const int toUp = std::abs(estimate - up);
  const int toUpLeft = std::abs(estimate - upLeft);
  return static_cast<unsigned char>(toLeft <= toUp && toLeft <= toUpLeft ? left : toUp <= toUpLeft ? up : upLeft);
}

// Undoes a row's filter in place. `previous` is the row above, zeros for the first; false for an unknown
// filter.
bool Unfilter(int filter, unsigned char* row, const unsigned char* previous, std::size_t rowBytes,
              std::size_t pixelBytes)
{
  for (std::size_t i = 0; i < rowBytes; ++i)
  {
    const unsigned char left = i >= pixelBytes ? row[i - pixelBytes] : 0;
    const unsigned char upLeft = i >= pixelBytes ? previous[i - pixelBytes] : 0;
    const unsigned char up = previous[i];
    switch (filter)
    {
      case 0:
        return true;
      case 1:
        row[i] = static_cast<unsigned char>(row[i] + left);
        break;
      case 2:
        row[i] = static_cast<unsigned char>(row[i] + up);
        break;
      case 3:
        row[i] = static_cast<unsigned char>(row[i] + (left + up) / 2);
        break;
      case 4:
        row[i] = static_cast<unsigned char>(row[i] + Paeth(left, up, upLeft));
        break;
      default:
        return false;
    }
  }
  return true;
}

}  // namespace

PngHeader ReadPngHeader(const std::string& fileName)
{
  InputFile input(fileName);
  return ReadHeader(input);
}

void ReadPng(const std::string& fileName, const PngHeader& expected, void* pixels)
{
  InputFile input(fileName);
  const PngHeader header = ReadHeader(input);
  if (header.width != expected.width || header.height != expected.height || header.elementType != expected.elementType)
  {
    throw FormatError(fileName + ": " + std::to_string(header.width) + " x " + std::to_string(header.height) + " " +
                      NameOf(header.elementType) + ", unlike the first image (" + std::to_string(expected.width) +
                      " x " + std::to_string(expected.height) + " " + NameOf(expected.elementType) + ")");
  }
  const std::size_t pixelBytes = BytesPerElement(header.elementType);
  const std::size_t rowBytes = static_cast<std::size_t>(header.width) * pixelBytes;
  std::vector<unsigned char> data((rowBytes + 1) * static_cast<std::size_t>(header.height));  // a filter byte a row
  InflateChunks(input, data);

  const std::vector<unsigned char> zeros(rowBytes, 0);
  const unsigned char* previous = zeros.data();
  auto* out = static_cast<unsigned char*>(pixels);
  for (int j = 0; j < header.height; ++j)
  {
    unsigned char* const row = &data[(rowBytes + 1) * static_cast<std::size_t>(j)] + 1;
    if (!Unfilter(row[-1], row, previous, rowBytes, pixelBytes))
    {
      throw Damaged(fileName);
    }
    previous = row;
    if (pixelBytes == 1)
    {
      std::memcpy(out, row, rowBytes);
    }
    else
    {
      for (std::size_t i = 0; i < rowBytes; i += 2)
      {
        const auto value = static_cast<std::uint16_t>(row[i] << 8 | row[i + 1]);
        std::memcpy(out + i, &value, 2);
      }
    }
    out += rowBytes;
  }
}

}  // namespace bigus
