// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/PngFile.h"

#include <spng.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr std::size_t kLargestChunk = 16u << 20;   // bytes of one chunk of text, a colour profile or the like
constexpr std::size_t kLargestChunks = 64u << 20;  // bytes of all of them

class PngDecoder
{
public:
  explicit PngDecoder(const std::string& fileName) : input_(fileName), png_(spng_ctx_new(0), spng_ctx_free)
  {
    if (!png_)
    {
      throw std::bad_alloc();
    }
    const auto read = [](spng_ctx*, void* input, void* bytes, std::size_t count) -> int
    { return static_cast<InputFile*>(input)->Read(bytes, count) == count ? SPNG_OK : SPNG_IO_EOF; };
    Require(spng_set_crc_action(png_.get(), SPNG_CRC_ERROR, SPNG_CRC_ERROR));
    Require(spng_set_chunk_limits(png_.get(), kLargestChunk, kLargestChunks));
    Require(spng_set_png_stream(png_.get(), read, &input_));
  }

  PngHeader Header()
  {
    spng_ihdr header;
    Require(spng_get_ihdr(png_.get(), &header));
    RequireFormat(header.width <= largestSide && header.height <= largestSide, input_.Name(), ": has ", header.width,
                  " x ", header.height, " pixels; at most ", largestSide, " a side are read");
    if ((header.bit_depth != 8 && header.bit_depth != 16) || header.interlace_method != SPNG_INTERLACE_NONE)
    {
      throw FormatError(input_.Name() + ": not an image of 8 or 16 bits without interlacing (PNG colour type " +
                        std::to_string(header.color_type) + ", depth " + std::to_string(header.bit_depth) +
                        ", interlacing " + std::to_string(header.interlace_method) + "); convert it to one");
    }
    const std::uint64_t pixels = std::uint64_t(header.width) * header.height;
    const int type = header.color_type;
    const int channels = type == SPNG_COLOR_TYPE_TRUECOLOR         ? 3
                         : type == SPNG_COLOR_TYPE_TRUECOLOR_ALPHA ? 4
                         : type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA ? 2
                                                                   : 1;
    isGrey_ = type == SPNG_COLOR_TYPE_GRAYSCALE;
    width_ = header.width;
    height_ = header.height;
    bytes_ = pixels * static_cast<unsigned>(channels) * (header.bit_depth / 8u);
    bigus::Require(FileFault::Truncated, bytes_ / deflateLimit <= input_.Size(), input_.Name(), ": claims ",
                   header.width, " x ", header.height, " pixels, more than its ", input_.Size(), " bytes can hold");
    return {static_cast<int>(header.width), static_cast<int>(header.height),
            isGrey_ && header.bit_depth == 16 ? ElementType::UInt16 : ElementType::UInt8, channels};
  }

  /// After Header(), whose pixels `pixels` has room for.
  void Read(void* pixels)
  {
    if (isGrey_)
    {
      Require(spng_decode_image(png_.get(), pixels, bytes_, SPNG_FMT_PNG, 0));
    }
    else
    {
      ReadColours(static_cast<unsigned char*>(pixels));
    }
    Require(spng_decode_chunks(png_.get()));  // to the end of the file
  }

private:
  void ReadColours(unsigned char* greys)
  {
    Require(spng_decode_image(png_.get(), nullptr, 0, SPNG_FMT_RGB8, SPNG_DECODE_PROGRESSIVE));
    std::vector<unsigned char> row(std::size_t(3) * width_);
    for (std::size_t j = 0; j < height_; ++j)
    {
      const int result = spng_decode_row(png_.get(), row.data(), row.size());
      if (!(result == SPNG_EOI && j + 1 == height_))  // the last row says that it is the last
      {
        Require(result);
      }
      for (std::size_t i = 0; i < width_; ++i)
      {
        *greys++ = Grey(row[3 * i], row[3 * i + 1], row[3 * i + 2]);
      }
    }
  }

  void Require(int result) const
  {
    RequireFormat(result == SPNG_OK, input_.Name(), ": not a PNG image, damaged or truncated: ", spng_strerror(result));
  }

  InputFile input_;
  std::unique_ptr<spng_ctx, void (*)(spng_ctx*)> png_;
  std::uint64_t bytes_ = 0;  ///< decoded
  std::size_t width_ = 0, height_ = 0;
  bool isGrey_ = true;
};

void RequireLike(const std::string& fileName, const PngHeader& header, const PngHeader& expected)
{
  RequireFormat(
      header.width == expected.width && header.height == expected.height && header.elementType == expected.elementType,
      fileName, ": ", header.width, " x ", header.height, " ", NameOf(header.elementType), ", unlike the first image (",
      expected.width, " x ", expected.height, " ", NameOf(expected.elementType), ")");
}

}  // namespace

std::vector<std::string> PngFilesOf(const std::string& folder)
{
  std::vector<std::string> files;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
  {
    if (Lowercase(entry->path().extension().string()) == ".png")
    {
      files.push_back(entry->path().string());
    }
  }
  Require(FileFault::CannotOpen, !error, folder, ": the folder cannot be read: ", error.message());
  std::sort(files.begin(), files.end(), InNaturalOrder);
  return files;
}

PngHeader ReadPngHeader(const std::string& fileName)
{
  return PngDecoder(fileName).Header();
}

void RequirePng(const std::string& fileName, const PngHeader& expected)
{
  RequireLike(fileName, ReadPngHeader(fileName), expected);
}

void ReadPng(const std::string& fileName, const PngHeader& expected, void* pixels)
{
  PngDecoder decoder(fileName);
  RequireLike(fileName, decoder.Header(), expected);
  decoder.Read(pixels);
}

}  // namespace bigus
