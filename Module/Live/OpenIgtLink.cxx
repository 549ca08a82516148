// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Live/OpenIgtLink.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "Core/Model/Error.h"
#include "IO/Formats/Xml.h"
#include "IO/SequenceFile.h"

namespace bigus
{
namespace
{

/// Bytes of a body: a colour picture of 4096 x 4096 pixels. More would be no frame of a scanner.
constexpr std::uint64_t kLargestBody = std::uint64_t(1) << 26;

/// Seconds that 32 bits hold.
constexpr double kLatestTime = 4294967295.0;

constexpr std::size_t kTypeBytes = 12, kDeviceBytes = 20;

// Codes of the protocol.
constexpr int kUnsigned8 = 3, kFloat32 = 10, kLittleEndian = 2, kRas = 1, kLps = 2, kAscii = 3;

/// Bytes of what a TRACKEDFRAME says of itself before picture and text: up to Plus 2.4, and since.
constexpr std::size_t kShortFrameHeader = 20, kFrameHeader = 86;

/// Bytes of a TRACKEDFRAME's text. Plus writes some 200 for each transform.
constexpr std::size_t kLargestText = std::size_t(1) << 20;

/// Kinds of pictures of a TRACKEDFRAME: not said, B-mode, and colours.
constexpr int kUnknownKind = 0, kBrightness = 1, kColours = 5;

/// Sides of a picture or an array.
constexpr int kLargestSide = 65535;

/// Numbers one after another, big-endian.
class Reader
{
public:
  Reader(const std::uint8_t* at, const std::uint8_t* end, std::string what) : at_(at), end_(end), what_(std::move(what))
  {
  }

  template <class T>
  T Next()
  {
    Require(sizeof(T));
    T value = 0;
    for (std::size_t k = 0; k < sizeof(T); ++k)
    {
      value = static_cast<T>(static_cast<std::uint64_t>(value) << 8 | *at_++);
    }
    return value;
  }

  float NextFloat()
  {
    const auto bits = Next<std::uint32_t>();
    float value;
    std::memcpy(&value, &bits, sizeof(value));
    bigus::Require(std::isfinite(value), what_, ": a number is not finite.");
    return value;
  }

  /// Text that ends at the first zero.
  std::string NextText(std::size_t bytes)
  {
    Require(bytes);
    const std::string text(reinterpret_cast<const char*>(at_), bytes);
    at_ += bytes;
    return text.substr(0, text.find('\0'));
  }

  void Skip(std::size_t bytes)
  {
    Require(bytes);
    at_ += bytes;
  }

  const std::uint8_t* at() const { return at_; }
  std::size_t Left() const { return static_cast<std::size_t>(end_ - at_); }

private:
  void Require(std::size_t bytes) const
  {
    bigus::Require(Left() >= bytes, what_, ": it ends ", bytes - Left(), " bytes too early.");
  }

  const std::uint8_t* at_;
  const std::uint8_t* end_;
  std::string what_;
};

class Writer
{
public:
  template <class T>
  void Put(T value)
  {
    std::array<std::uint8_t, sizeof(T)> big;
    for (std::size_t k = 0; k < sizeof(T); ++k)
    {
      big[k] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * (sizeof(T) - 1 - k));
    }
    bytes.insert(bytes.end(), big.begin(), big.end());
  }
  void PutFloat(double value)
  {
    const float single = static_cast<float>(value);
    std::uint32_t bits;
    std::memcpy(&bits, &single, sizeof(bits));
    Put(bits);
  }
  void PutText(std::string text, std::size_t count)
  {
    text.resize(count, '\0');
    bytes.insert(bytes.end(), text.begin(), text.end());
  }
  std::vector<std::uint8_t> bytes;
};

/// Bytes whose checksum is looked up together, four times as fast as one by one. Slices with coverage have up to 16 MB.
constexpr std::size_t kTogether = 8;

/// `[k][byte]`: what a byte leaves in the checksum when k bytes follow it.
using ChecksumTables = std::array<std::array<std::uint64_t, 256>, kTogether>;

ChecksumTables MakeChecksumTables()
{
  ChecksumTables tables{};
  for (std::uint64_t byte = 0; byte < 256; ++byte)
  {
    std::uint64_t rest = byte << 56;
    for (std::array<std::uint64_t, 256>& table : tables)
    {
      for (int bit = 0; bit < 8; ++bit)
      {
        rest = rest >> 63 ? rest << 1 ^ 0x42F0E1EBA9EA3693u : rest << 1;
      }
      table[byte] = rest;
    }
  }
  return tables;
}

/// CRC-64 of ECMA-182: polynomial 42F0E1EBA9EA3693, from 0, bits in their order. It is linear, so bytes may be looked up
/// one by one and put together.
std::uint64_t Checksum(const std::uint8_t* bytes, std::size_t count)
{
  static const ChecksumTables tables = MakeChecksumTables();
  std::uint64_t sum = 0;
  for (; count >= kTogether; count -= kTogether, bytes += kTogether)
  {
    std::uint64_t next = 0;
    for (std::size_t k = 0; k < kTogether; ++k)
    {
      const std::size_t shift = 8 * (kTogether - 1 - k);
      next ^= tables[kTogether - 1 - k][(sum >> shift ^ bytes[k]) & 0xFF];
    }
    sum = next;
  }
  for (; count > 0; --count, ++bytes)
  {
    sum = tables[0][sum >> 56 ^ *bytes] ^ sum << 8;
  }
  return sum;
}

std::string NameOf(const IgtHeader& header)
{
  return header.type + " message of '" + header.device + "'";
}

/// The content of a whole body, without what version 3 of the protocol puts before and after it.
Reader ContentOf(const IgtHeader& header, const std::vector<std::uint8_t>& body)
{
  Require(body.size() == header.bodyBytes, NameOf(header), ": it has ", body.size(), " of ", header.bodyBytes,
          " bytes.");
  if (header.checksum != 0 && header.checksum != Checksum(body.data(), body.size()))  // 0: the sender made none
  {
    throw Error(NameOf(header) + ": its checksum is another, so it was damaged on its way.");
  }
  const std::uint8_t *begin = body.data(), *end = begin + body.size();
  if (header.version >= 2)
  {
    Reader extended(begin, end, NameOf(header));
    const auto extendedBytes = extended.Next<std::uint16_t>(), metadataHeaderBytes = extended.Next<std::uint16_t>();
    const auto metadataBytes = extended.Next<std::uint32_t>();
    const std::uint64_t around = std::uint64_t(extendedBytes) + metadataHeaderBytes + metadataBytes;
    Require(around <= body.size(), NameOf(header), ": ", around, " bytes are said to surround its content, but it has ",
            body.size(), ".");
    begin += extendedBytes;
    end -= metadataHeaderBytes + std::uint64_t(metadataBytes);
  }
  return Reader(begin, end, NameOf(header));
}

/// Three columns and a place, as both messages have them.
Eigen::Matrix4d NextMatrix(Reader& content)
{
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (int column = 0; column < 4; ++column)
  {
    for (int row = 0; row < 3; ++row)
    {
      matrix(row, column) = content.NextFloat();
    }
  }
  return matrix;
}

void PutMatrix(const Eigen::Matrix4d& matrix, Writer& to)
{
  for (int column = 0; column < 4; ++column)
  {
    for (int row = 0; row < 3; ++row)
    {
      to.PutFloat(matrix(row, column));
    }
  }
}

std::vector<std::uint8_t> WithHeader(const std::string& type, const std::string& device, double timestamp,
                                     const std::vector<std::uint8_t>& body)
{
  Writer message;
  message.Put<std::uint16_t>(1);
  message.PutText(type, kTypeBytes);
  message.PutText(device, kDeviceBytes);
  const double time = std::isfinite(timestamp) ? std::clamp(timestamp, 0.0, kLatestTime) : 0.0;
  const double seconds = std::floor(time);
  message.Put(static_cast<std::uint32_t>(seconds));
  message.Put(static_cast<std::uint32_t>(std::ldexp(time - seconds, 32)));
  message.Put<std::uint64_t>(body.size());
  message.Put(Checksum(body.data(), body.size()));
  message.bytes.insert(message.bytes.end(), body.begin(), body.end());
  return std::move(message.bytes);
}

/// From the first pixel to the picture's middle, which is its place in the protocol.
Eigen::Vector4d ToMiddle(const Eigen::Matrix4d& matrix, int width, int height)
{
  return 0.5 * (width - 1) * matrix.col(0) + 0.5 * (height - 1) * matrix.col(1);
}

}  // namespace

IgtHeader ParseIgtHeader(const std::uint8_t* bytes)
{
  Reader reader(bytes, bytes + kIgtHeaderBytes, "OpenIGTLink header");
  IgtHeader header;
  header.version = reader.Next<std::uint16_t>();
  header.type = reader.NextText(kTypeBytes);
  header.device = reader.NextText(kDeviceBytes);
  const auto isPlain = [](char c) { return c >= ' ' && c <= '~'; };
  Require(header.version >= 1 && header.version <= 3 && !header.type.empty() &&
              std::all_of(header.type.begin(), header.type.end(), isPlain),
          "OpenIGTLink header: version ", header.version,
          " and a type that is no word. What sends here does not speak OpenIGTLink.");
  std::replace_if(
      header.device.begin(), header.device.end(), [&](char c) { return !isPlain(c); }, '?');
  const auto seconds = reader.Next<std::uint32_t>(), fraction = reader.Next<std::uint32_t>();
  header.timestamp = seconds + std::ldexp(fraction, -32);
  header.bodyBytes = reader.Next<std::uint64_t>();
  header.checksum = reader.Next<std::uint64_t>();
  Require(header.bodyBytes <= kLargestBody, NameOf(header), ": it has ", header.bodyBytes, " bytes, more than ",
          kLargestBody, ". Have the sender make its pictures smaller.");
  return header;
}

namespace
{

/// Whether a pixel has so many components: grey, red green blue, or these and how opaque it is.
bool AreComponents(int components)
{
  return components == 1 || components == 3 || components == 4;
}

/// Pixels as they come, colours as the grey that files of colours become.
std::vector<std::uint8_t> GreyPixels(const std::uint8_t* bytes, std::size_t pixels, int components)
{
  if (components == 1)
  {
    return {bytes, bytes + pixels};
  }
  std::vector<std::uint8_t> greys(pixels);
  for (std::uint8_t& grey : greys)
  {
    grey = Grey(bytes[0], bytes[1], bytes[2]);
    bytes += components;
  }
  return greys;
}

/// How a TRACKEDFRAME's rows and columns get into marked-far order, by the number of its order in Plus.
struct Turn
{
  bool flipsColumns, flipsRows;
};

Turn TurnOf(int order, const std::string& name)
{
  switch (order)
  {
    case 0:  // not said
    case 5:  // MF, MFA
    case 6:  // MFD
      return {false, false};
    case 1:  // UF, UFD
    case 2:  // UFA
      return {true, false};
    case 3:  // UN, UNA
    case 4:  // UND
      return {true, true};
    case 8:  // MN, MND
    case 9:  // MNA
      return {false, true};
    default:
      throw Error(name + ": its pixels lie in an order of number " + std::to_string(order) +
                  ", which is not followed. Set PortUsImageOrientation to MF in the configuration of Plus.");
  }
}

void ReverseColumns(IgtImage& image)
{
  for (auto row = image.pixels.begin(); row != image.pixels.end(); row += image.width)
  {
    std::reverse(row, row + image.width);
  }
}

void ReverseRows(IgtImage& image)
{
  for (int top = 0, bottom = image.height - 1; top < bottom; ++top, --bottom)
  {
    const auto row = [&image](int j) { return image.pixels.begin() + static_cast<std::ptrdiff_t>(j) * image.width; };
    std::swap_ranges(row(top), row(top) + image.width, row(bottom));
  }
}

/// A float as Plus leaves it: the matrix of a TRACKEDFRAME is the one thing that it sends in its own machine's order of
/// bytes, and Plus runs on machines whose lowest byte comes first.
float LittleEndianFloat(const std::uint8_t* bytes)
{
  const std::uint32_t bits =
      bytes[0] | std::uint32_t(bytes[1]) << 8 | std::uint32_t(bytes[2]) << 16 | std::uint32_t(bytes[3]) << 24;
  float value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

/// Names and values of <TrackedFrame><FrameField Name="" Value=""/>...; older ones call it CustomFrameField.
std::map<std::string, std::string> FieldsOf(std::string_view text, const std::string& name)
{
  const pugi::xml_document document = ParseXml(text, name + ": its text");
  const pugi::xml_node root = document.document_element();
  std::map<std::string, std::string> fields;
  for (const pugi::xml_node& element : root.children())
  {
    const std::string_view kind = element.name();
    const pugi::xml_attribute key = element.attribute("Name"), value = element.attribute("Value");
    if ((kind == "FrameField" || kind == "CustomFrameField") && key && value)
    {
      fields[key.value()] = value.value();
    }
  }
  Require(root.attribute("ImageDataValid").value() != std::string_view("false"), name,
          ": it holds no picture (ImageDataValid is false).");
  return fields;
}

}  // namespace

IgtImage ParseIgtImage(const IgtHeader& header, const std::vector<std::uint8_t>& body)
{
  Reader content = ContentOf(header, body);
  content.Skip(sizeof(std::uint16_t));  // version of what follows
  const int components = content.Next<std::uint8_t>(), type = content.Next<std::uint8_t>();
  content.Skip(1);  // order of bytes, which single ones have not
  const int coordinates = content.Next<std::uint8_t>();
  int size[3], offset[3], part[3];
  for (int& side : size)
  {
    side = content.Next<std::uint16_t>();
  }
  const Eigen::Matrix4d matrix = NextMatrix(content);
  for (int& first : offset)
  {
    first = content.Next<std::uint16_t>();
  }
  for (int& side : part)
  {
    side = content.Next<std::uint16_t>();
  }
  Require(AreComponents(components) && type == kUnsigned8, NameOf(header), ": it has ", components,
          " components of type ", type,
          "; grey (1) and colours (3, 4) of unsigned 8 bits (3) are followed. Set the sender to grey pictures.");
  Require(size[2] == 1 && size[0] >= 1 && size[1] >= 1, NameOf(header), ": it has ", size[0], " x ", size[1], " x ",
          size[2], " pixels; a frame has one slice.");
  if (!std::equal(size, size + 3, part) || std::any_of(offset, offset + 3, [](int first) { return first != 0; }))
  {
    throw Error(NameOf(header) + ": it is part of a picture; whole ones are followed.");
  }
  Require(coordinates == kRas || coordinates == kLps, NameOf(header), ": its coordinates are ", coordinates,
          ", neither RAS (1) nor LPS (2).");
  IgtImage image;
  image.width = size[0];
  image.height = size[1];
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  Require(content.Left() == pixels * components, NameOf(header), ": it has ", content.Left(), " bytes of pixels for ",
          image.width, " x ", image.height, " of ", components, ".");
  image.pixels = GreyPixels(content.at(), pixels, components);
  image.imageToWorld = matrix;
  image.imageToWorld.col(3) -= ToMiddle(matrix, image.width, image.height);
  if (coordinates == kLps)
  {
    image.imageToWorld.topRows(2) *= -1;
  }
  return image;
}

Eigen::Matrix4d ParseIgtTransform(const IgtHeader& header, const std::vector<std::uint8_t>& body)
{
  Reader content = ContentOf(header, body);
  const Eigen::Matrix4d matrix = NextMatrix(content);
  Require(content.Left() == 0, NameOf(header), ": it has ", content.Left(), " bytes too many.");
  return matrix;
}

std::string ParseIgtString(const IgtHeader& header, const std::vector<std::uint8_t>& body)
{
  Reader content = ContentOf(header, body);
  content.Skip(sizeof(std::uint16_t));  // the encoding: texts here are ASCII, which all share
  const auto bytes = content.Next<std::uint16_t>();
  const char* text = reinterpret_cast<const char*>(content.at());
  content.Skip(bytes);
  Require(content.Left() == 0, NameOf(header), ": it has ", content.Left(), " bytes too many.");
  return {text, bytes};
}

IgtTrackedFrame ParseIgtTrackedFrame(const IgtHeader& header, const std::vector<std::uint8_t>& body)
{
  const std::string name = NameOf(header);
  Reader content = ContentOf(header, body);
  const std::size_t size = content.Left();
  const int type = content.Next<std::uint16_t>(), components = content.Next<std::uint16_t>();
  const int kind = content.Next<std::uint16_t>();
  int sides[3];
  for (int& side : sides)
  {
    side = content.Next<std::uint16_t>();
  }
  const std::size_t imageBytes = content.Next<std::uint32_t>(), textBytes = content.Next<std::uint32_t>();
  const bool isKind = kind == kUnknownKind || kind == (components == 1 ? kBrightness : kColours);
  Require(AreComponents(components) && type == kUnsigned8 && isKind, name, ": it has ", components,
          " components of type ", type, " and kind ", kind,
          "; one of B-mode (1), or 3 or 4 of colours (5), of unsigned 8 bits (3) are followed. Set the sender to "
          "grey pictures.");
  const std::size_t pixels = static_cast<std::size_t>(sides[0]) * static_cast<std::size_t>(sides[1]);
  Require(sides[2] == 1 && sides[0] >= 1 && sides[1] >= 1 && imageBytes == pixels * components, name, ": it has ",
          sides[0], " x ", sides[1], " x ", sides[2], " pixels in ", imageBytes,
          " bytes; a frame has one slice, and a byte a pixel and component.");
  Require(textBytes <= kLargestText, name, ": its text has ", textBytes, " bytes, more than ", kLargestText, ".");
  const bool isLong = size == kFrameHeader + imageBytes + textBytes;
  Require(isLong || size == kShortFrameHeader + imageBytes + textBytes, name, ": it has ", size,
          " bytes for a picture of ", imageBytes, " and a text of ", textBytes, ".");

  IgtTrackedFrame frame;
  Turn turn = {false, false};
  if (isLong)
  {
    turn = TurnOf(content.Next<std::uint16_t>(), name);
    Eigen::Matrix4d matrix;
    for (int row = 0; row < 4; ++row)
    {
      for (int column = 0; column < 4; ++column)
      {
        matrix(row, column) = LittleEndianFloat(content.at());
        content.Skip(sizeof(float));
      }
    }
    // Plus sends the identity where nothing is embedded.
    frame.hasPose = matrix.allFinite() && !matrix.isIdentity(0) && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
    frame.image.imageToWorld = frame.hasPose ? matrix : Eigen::Matrix4d::Identity();
  }
  const char* text = reinterpret_cast<const char*>(content.at());
  content.Skip(textBytes);
  frame.fields = FieldsOf({text, textBytes}, name);
  frame.image.width = sides[0];
  frame.image.height = sides[1];
  frame.image.pixels = GreyPixels(content.at(), pixels, components);
  if (turn.flipsColumns)
  {
    ReverseColumns(frame.image);
  }
  if (turn.flipsRows)
  {
    ReverseRows(frame.image);
  }
  return frame;
}

std::vector<std::uint8_t> PackIgtImage(const std::string& device, double timestamp, const IgtImage& image)
{
  Require(image.width >= 1 && image.height >= 1 && image.width <= kLargestSide && image.height <= kLargestSide,
          "OpenIGTLink: a picture of ", image.width, " x ", image.height,
          " pixels cannot be sent; sides go up to 65535.");
  Writer body;
  body.Put<std::uint16_t>(1);
  for (const int code : {1, kUnsigned8, kLittleEndian, kRas})
  {
    body.Put(static_cast<std::uint8_t>(code));
  }
  const int size[3] = {image.width, image.height, 1};
  for (const int side : size)
  {
    body.Put(static_cast<std::uint16_t>(side));
  }
  Eigen::Matrix4d matrix = image.imageToWorld;
  matrix.col(3) += ToMiddle(matrix, image.width, image.height);
  PutMatrix(matrix, body);
  for (const int first : {0, 0, 0})
  {
    body.Put(static_cast<std::uint16_t>(first));
  }
  for (const int side : size)
  {
    body.Put(static_cast<std::uint16_t>(side));
  }
  body.bytes.insert(body.bytes.end(), image.pixels.begin(), image.pixels.end());
  return WithHeader("IMAGE", device, timestamp, body.bytes);
}

std::vector<std::uint8_t> PackIgtTransform(const std::string& device, double timestamp, const Eigen::Matrix4d& matrix)
{
  Writer body;
  PutMatrix(matrix, body);
  return WithHeader("TRANSFORM", device, timestamp, body.bytes);
}

std::vector<std::uint8_t> PackIgtString(const std::string& device, double timestamp, const std::string& text)
{
  Require(text.size() <= UINT16_MAX, "OpenIGTLink: a text of ", text.size(), " bytes cannot be sent; 65535 can.");
  Writer body;
  body.Put<std::uint16_t>(kAscii);
  body.Put(static_cast<std::uint16_t>(text.size()));
  body.PutText(text, text.size());
  return WithHeader("STRING", device, timestamp, body.bytes);
}

std::vector<std::uint8_t> PackIgtArray(const std::string& device, double timestamp, const std::vector<int>& sides,
                                       const std::vector<float>& values)
{
  Writer body;
  body.Put(static_cast<std::uint8_t>(kFloat32));
  body.Put(static_cast<std::uint8_t>(sides.size()));
  std::size_t count = 1;
  for (const int side : sides)
  {
    Require(side >= 0 && side <= kLargestSide, "OpenIGTLink: an array with a side of ", side,
            " cannot be sent; 0 to 65535 can.");
    count *= static_cast<std::size_t>(side);
    body.Put(static_cast<std::uint16_t>(side));
  }
  Require(count == values.size(), "OpenIGTLink: an array has ", values.size(), " values and room for ", count, ".");
  body.bytes.reserve(body.bytes.size() + sizeof(float) * count);
  for (const float value : values)
  {
    body.PutFloat(value);
  }
  return WithHeader("NDARRAY", device, timestamp, body.bytes);
}

}  // namespace bigus
