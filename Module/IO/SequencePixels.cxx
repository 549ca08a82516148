// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The pixels of a tracked sequence, decoded into buffers whose size the caller has checked.
#include <zlib.h>

#include <algorithm>
#include <cstring>

#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"

namespace bigus
{
class PixelStream::Decoder
{
public:
  explicit Decoder(const SequenceFile& file)
      : name_(file.fileName), input_(file.dataFile), left_(file.dataBytes), compressed_(file.encoding != Encoding::Raw)
  {
    input_.Seek(file.dataOffset);
    // 15 + 32: the largest window, and zlib or gzip as the first bytes say.
    Require(FileFault::Unknown, !compressed_ || inflateInit2(&zlib_, 15 + 32) == Z_OK, name_,
            ": zlib cannot be started");
  }

  ~Decoder()
  {
    if (compressed_)
    {
      inflateEnd(&zlib_);
    }
  }

  /// Returns fewer bytes than asked for at the end of the data.
  std::size_t Read(unsigned char* bytes, std::size_t count)
  {
    if (!compressed_)
    {
      const std::size_t got = input_.Read(bytes, static_cast<std::size_t>(std::min<std::uint64_t>(count, left_)));
      left_ -= got;
      return got;
    }
    std::size_t done = 0;
    while (done < count && !ended_)
    {
      Fill();
      const auto room = static_cast<uInt>(std::min<std::size_t>(count - done, 1u << 30));
      zlib_.next_out = bytes + done;
      zlib_.avail_out = room;
      const int result = inflate(&zlib_, Z_NO_FLUSH);
      done += room - zlib_.avail_out;
      if (result == Z_STREAM_END)
      {
        ended_ = true;
      }
      else if (result == Z_BUF_ERROR && left_ == 0 && zlib_.avail_in == 0)
      {
        return done;
      }
      else if (result != Z_OK && result != Z_BUF_ERROR)
      {
        throw FormatError(name_ + ": the compressed pixels are damaged (" +
                          (zlib_.msg ? zlib_.msg : "zlib error " + std::to_string(result)) + ")");
      }
    }
    return done;
  }

  /// Whether the stream has come to its proper end.
  bool AtEnd()
  {
    unsigned char extra = 0;
    const bool more = Read(&extra, 1) != 0;
    return !more && (!compressed_ || ended_);
  }

private:
  void Fill()
  {
    if (zlib_.avail_in == 0 && left_ > 0)
    {
      const std::size_t got =
          input_.Read(buffer_, static_cast<std::size_t>(std::min<std::uint64_t>(sizeof(buffer_), left_)));
      left_ = got == 0 ? 0 : left_ - got;
      zlib_.next_in = buffer_;
      zlib_.avail_in = static_cast<uInt>(got);
    }
  }

  std::string name_;
  InputFile input_;
  std::uint64_t left_;
  bool compressed_;
  bool ended_ = false;
  z_stream zlib_ = {};
  unsigned char buffer_[64 * 1024];
};

PixelStream::PixelStream(const SequenceFile& file) : decoder_(std::make_unique<Decoder>(file)), file_(file) {}

PixelStream::~PixelStream() = default;

void PixelStream::Read(void* bytes, std::size_t count)
{
  auto* const out = static_cast<unsigned char*>(bytes);
  if (file_.channels > 1)
  {
    ReadColours(out, count);
    return;
  }
  ReadElements(out, count);
  if (file_.isSigned)
  {
    for (std::size_t at = 0; at < count; at += 2)
    {
      std::int16_t pixel;
      std::memcpy(&pixel, out + at, 2);
      if (pixel < 0)
      {
        throw FormatError(file_.fileName + ": has the pixel " + std::to_string(pixel) +
                          "; pixels of type short are read where none is negative");
      }
    }
  }
}

void PixelStream::ReadColours(unsigned char* greys, std::size_t count)
{
  constexpr std::size_t kBlock = 16384;  // pixels
  const auto channels = static_cast<std::size_t>(file_.channels);
  std::vector<unsigned char> colours(std::min(count, kBlock) * channels);
  for (std::size_t done = 0; done < count;)
  {
    const std::size_t pixels = std::min(count - done, kBlock);
    ReadElements(colours.data(), pixels * channels);
    for (std::size_t p = 0; p < pixels; ++p)
    {
      const unsigned char* colour = &colours[p * channels];
      greys[done + p] = Grey(colour[0], colour[1], colour[2]);
    }
    done += pixels;
  }
}

void PixelStream::ReadElements(unsigned char* out, std::size_t count)
{
  Require(FileFault::Truncated, decoder_->Read(out, count) == count, file_.fileName,
          ": the pixels end early; the file is truncated or its sizes are wrong");
  const std::size_t elementBytes = BytesPerElement(file_.elementType);
  if (elementBytes > 1 && file_.bigEndian != kThisMachineIsBigEndian)
  {
    SwapBytes(out, count, elementBytes);
  }
}

void PixelStream::Finish()
{
  RequireFormat(decoder_->AtEnd(), file_.fileName,
                ": the pixel data do not end where the header says; they are damaged or the sizes are wrong");
}

}  // namespace bigus
