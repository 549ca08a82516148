// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The .vtp side of FieldData.h: VTK's XML format for PolyData,
// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html. Ours because VTK 9.1's reader crashes
// on damaged files and takes some truncated ones for whole.
#include <algorithm>
#include <cstring>

#include "FieldData.h"
#include "FileError.h"
#include "Text.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkStringArray.h"
#include "vtk_pugixml.h"
#include "vtk_zlib.h"

namespace bigus
{
namespace
{

constexpr std::uint64_t largestFile = std::uint64_t(4) << 30;
constexpr std::int64_t mostPoints = 1000000000;
constexpr std::int64_t mostComponents = 16;
constexpr std::uint64_t unknownSize = ~std::uint64_t(0);

struct Number
{
  char kind;  // 'i' signed, 'u' unsigned, 'f' floating
  std::size_t bytes;
};

bool ParseType(const std::string& text, Number& number)
{
  const std::size_t digits = text.find_first_of("0123456789");
  const std::string name = text.substr(0, digits);
  std::int64_t bits = 0;
  if (digits == std::string::npos || !ParseNumber(text.substr(digits), bits) ||
      (name != "Int" && name != "UInt" && name != "Float"))
  {
    return false;
  }
  number = {name == "Int" ? 'i' : name == "UInt" ? 'u' : 'f', static_cast<std::size_t>(bits / 8)};
  return bits == 32 || bits == 64 || (number.kind != 'f' && (bits == 8 || bits == 16));
}

template <class T>
double As(const unsigned char* bytes)
{
  T value;
  std::memcpy(&value, bytes, sizeof(value));
  return static_cast<double>(value);
}

double Decode(Number number, const unsigned char* bytes)
{
  switch (number.kind)
  {
    case 'i':
      return number.bytes == 1   ? As<std::int8_t>(bytes)
             : number.bytes == 2 ? As<std::int16_t>(bytes)
             : number.bytes == 4 ? As<std::int32_t>(bytes)
                                 : As<std::int64_t>(bytes);
    case 'u':
      return number.bytes == 1   ? As<std::uint8_t>(bytes)
             : number.bytes == 2 ? As<std::uint16_t>(bytes)
             : number.bytes == 4 ? As<std::uint32_t>(bytes)
                                 : As<std::uint64_t>(bytes);
    default:
      return number.bytes == 4 ? As<float>(bytes) : As<double>(bytes);
  }
}

bool ThisMachineIsBigEndian()
{
  const std::uint16_t one = 1;
  unsigned char first = 0;
  std::memcpy(&first, &one, 1);
  return first == 0;
}

// Up to the first character that is not base64. Groups may be padded anywhere: VTK pads its headers on their
// own.
std::string FromBase64(std::string_view text)
{
  const auto value = [](char c)
  {
    return c >= 'A' && c <= 'Z'   ? c - 'A'
           : c >= 'a' && c <= 'z' ? c - 'a' + 26
           : c >= '0' && c <= '9' ? c - '0' + 52
           : c == '+'             ? 62
           : c == '/'             ? 63
           : c == '='             ? 0
                                  : -1;
  };
  std::string bytes;
  for (std::size_t i = 0; i + 4 <= text.size(); i += 4)
  {
    int group = 0;
    for (std::size_t k = 0; k < 4; ++k)
    {
      const int digit = value(text[i + k]);
      if (digit < 0)
      {
        return bytes;
      }
      group = group << 6 | digit;
    }
    const int count = text[i + 2] == '=' ? 1 : text[i + 3] == '=' ? 2 : 3;
    for (int k = 0; k < count; ++k)
    {
      bytes += static_cast<char>(group >> (16 - 8 * k));
    }
  }
  return bytes;
}

class VtpFile
{
public:
  explicit VtpFile(const std::string& fileName) : name_(fileName), text_(ReadTextFile(fileName, largestFile))
  {
    // What follows <AppendedData ...> _ is not XML.
    const std::size_t appended = text_.find("<AppendedData");
    std::string beforeAppended;
    if (text_.find("</VTKFile>", text_.size() - std::min<std::size_t>(text_.size(), 64)) == std::string::npos)
    {
      throw TruncationError(name_ + ": does not end with </VTKFile>; the file is truncated");
    }
    if (appended != std::string::npos)
    {
      const std::size_t begin = text_.find('_', appended);
      const std::size_t end = text_.rfind("</AppendedData>");
      if (begin == std::string::npos || end == std::string::npos || end < begin)
      {
        throw Damaged("the appended data");
      }
      const std::string_view tag = std::string_view(text_).substr(appended, begin - appended);
      appendedIsRaw_ = tag.find("\"raw\"") != std::string_view::npos;
      appended_ = std::string_view(text_).substr(begin + 1, end - begin - 1);
      beforeAppended = text_.substr(0, appended) + "</VTKFile>";
    }
    const std::string& xml = appended != std::string::npos ? beforeAppended : text_;
    const auto parsed = document_.load_buffer(xml.data(), xml.size());
    if (!parsed)
    {
      throw FormatError(name_ + ": not valid XML: " + parsed.description() + " at byte " +
                        std::to_string(parsed.offset));
    }
    const pugi::xml_node root = document_.document_element();
    const std::string compressor = root.attribute("compressor").value();
    if (std::strcmp(root.name(), "VTKFile") != 0 || std::strcmp(root.attribute("type").value(), "PolyData") != 0)
    {
      throw FormatError(name_ + ": not a VTK XML PolyData file");
    }
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
    {
      throw FormatError(name_ + ": compressor " + Quoted(compressor) + "; vtkZLibDataCompressor and none are read");
    }
    compressed_ = !compressor.empty();
    swap_ = (std::strcmp(root.attribute("byte_order").value(), "BigEndian") == 0) != ThisMachineIsBigEndian();
    headerBytes_ = std::strcmp(root.attribute("header_type").value(), "UInt64") == 0 ? 8 : 4;
    polyData_ = root.child("PolyData");
    piece_ = polyData_.child("Piece");
    if (!piece_ || piece_.next_sibling("Piece"))
    {
      throw FormatError(name_ + ": must have one Piece");
    }
    const std::string points = piece_.attribute("NumberOfPoints").value();
    if (!ParseNumber(points, points_) || points_ < 0 || points_ > mostPoints)
    {
      throw FormatError(name_ + ": NumberOfPoints is " + Quoted(points) + "; 0 to " + std::to_string(mostPoints) +
                        " are read");
    }
  }

  void Fill(vtkPolyData* polyData)
  {
    if (const pugi::xml_node array = piece_.child("Points").child("DataArray"); array && points_ > 0)
    {
      vtkNew<vtkDoubleArray> coordinates;
      ReadNumbers(array, "Points", points_, coordinates);
      if (coordinates->GetNumberOfComponents() != 3)
      {
        throw FormatError(name_ + ": Points must have 3 components");
      }
      vtkNew<vtkPoints> points;
      points->SetData(coordinates);
      polyData->SetPoints(points);
    }
    else if (points_ > 0)
    {
      throw FormatError(name_ + ": the array Points is missing");
    }
    for (const char* name : {"Scale", "Rotation", "Reflectivity"})
    {
      AddNumbers(piece_.child("PointData"), name, points_, polyData->GetPointData());
    }
    for (const char* name : {"Gamma", "ElevationSigma", "FormatVersion"})
    {
      AddNumbers(polyData_.child("FieldData"), name, 1, polyData->GetFieldData());
    }
    if (const auto array = polyData_.child("FieldData").find_child_by_attribute("Array", "Name", "Provenance"))
    {
      AddStrings(array, polyData->GetFieldData());
    }
  }

private:
  FileError Damaged(const std::string& what) const
  {
    return FormatError(name_ + ": " + what + " is damaged, truncated or of another size than stated");
  }

  void AddNumbers(pugi::xml_node parent, const char* name, std::int64_t tuples, vtkFieldData* data)
  {
    if (const auto node = parent.find_child_by_attribute("DataArray", "Name", name))
    {
      vtkNew<vtkDoubleArray> array;
      ReadNumbers(node, name, tuples, array);
      data->AddArray(array);
    }
  }

  // The array's values as double. `tuples` is what an array of the piece has; the file's own word goes before
  // it.
  void ReadNumbers(pugi::xml_node node, const char* name, std::int64_t tuples, vtkDoubleArray* array)
  {
    Number number{};
    std::int64_t components = 1;
    const pugi::xml_attribute statedTuples = node.attribute("NumberOfTuples");
    const pugi::xml_attribute statedComponents = node.attribute("NumberOfComponents");
    if (!ParseType(node.attribute("type").value(), number))
    {
      throw FormatError(name_ + ": " + name + " has the type " + Quoted(node.attribute("type").value()) +
                        "; numbers of 8 to 64 bits are read");
    }
    if ((statedTuples && (!ParseNumber(statedTuples.value(), tuples) || tuples < 0 || tuples > mostPoints)) ||
        (statedComponents &&
         (!ParseNumber(statedComponents.value(), components) || components < 1 || components > mostComponents)))
    {
      throw FormatError(name_ + ": " + name + " claims " + Quoted(statedTuples.value()) + " tuples of " +
                        Quoted(statedComponents.value()) + " components");
    }
    const auto count = static_cast<std::uint64_t>(tuples * components);
    std::vector<double> values;
    if (std::strcmp(node.attribute("format").value(), "ascii") == 0)
    {
      const std::string_view text = node.child_value();
      if (count > text.size())
      {
        throw Damaged(name);
      }
      values.resize(count);
      if (!ParseNumbers(text, count, values.data()))
      {
        throw Damaged(name);
      }
    }
    else
    {
      std::string bytes = ReadBytes(node, name, count * number.bytes);
      values.resize(count);
      for (std::size_t i = 0; i < count; ++i)
      {
        auto* const at = reinterpret_cast<unsigned char*>(&bytes[i * number.bytes]);
        if (swap_)
        {
          std::reverse(at, at + number.bytes);
        }
        values[i] = Decode(number, at);
      }
    }
    array->SetName(name);
    array->SetNumberOfComponents(static_cast<int>(components));
    array->SetNumberOfTuples(tuples);
    std::copy(values.begin(), values.end(), array->GetPointer(0));
  }

  // Strings are stored one after the other, each with a zero at its end; in ascii as numbers.
  void AddStrings(pugi::xml_node node, vtkFieldData* data)
  {
    std::string bytes;
    if (std::strcmp(node.attribute("format").value(), "ascii") == 0)
    {
      for (const auto word : Words(node.child_value()))
      {
        std::int64_t code = 0;
        if (!ParseNumber(word, code) || code < -128 || code > 255)
        {
          throw Damaged("Provenance");
        }
        bytes += static_cast<char>(code);
      }
    }
    else
    {
      bytes = ReadBytes(node, "Provenance", unknownSize);
    }
    vtkNew<vtkStringArray> strings;
    strings->SetName("Provenance");
    for (std::size_t begin = 0; begin < bytes.size();)
    {
      const std::size_t end = std::min(bytes.find('\0', begin), bytes.size());
      strings->InsertNextValue(bytes.substr(begin, end - begin));
      begin = end + 1;
    }
    data->AddArray(strings);
  }

  // The decoded bytes of a binary or appended array, which must be `expected` unless that is unknownSize.
  std::string ReadBytes(pugi::xml_node node, const std::string& what, std::uint64_t expected)
  {
    std::string decoded;
    std::string_view stored;
    if (std::strcmp(node.attribute("format").value(), "appended") == 0)
    {
      std::int64_t offset = -1;
      if (!ParseNumber(node.attribute("offset").value(), offset) || offset < 0 ||
          static_cast<std::uint64_t>(offset) > appended_.size())
      {
        throw Damaged(what);
      }
      stored = appended_.substr(static_cast<std::size_t>(offset));
      if (!appendedIsRaw_)
      {
        decoded = FromBase64(stored);
        stored = decoded;
      }
    }
    else if (std::strcmp(node.attribute("format").value(), "binary") == 0)
    {
      decoded = FromBase64(Trimmed(node.child_value()));
      stored = decoded;
    }
    else
    {
      throw FormatError(name_ + ": " + what + " has the format " + Quoted(node.attribute("format").value()) +
                        "; ascii, binary and appended are read");
    }
    return compressed_ ? Inflate(stored, what, expected) : Plain(stored, what, expected);
  }

  std::uint64_t TakeHeader(std::string_view& stored, const std::string& what) const
  {
    if (stored.size() < headerBytes_)
    {
      throw Damaged(what);
    }
    unsigned char bytes[8];
    std::memcpy(bytes, stored.data(), headerBytes_);
    if (swap_)
    {
      std::reverse(bytes, bytes + headerBytes_);
    }
    stored.remove_prefix(headerBytes_);
    std::uint64_t wide = 0;
    std::uint32_t narrow = 0;
    std::memcpy(headerBytes_ == 8 ? static_cast<void*>(&wide) : &narrow, bytes, headerBytes_);
    return headerBytes_ == 8 ? wide : narrow;
  }

  // Byte count, then the bytes.
  std::string Plain(std::string_view stored, const std::string& what, std::uint64_t expected) const
  {
    const std::uint64_t size = TakeHeader(stored, what);
    if (size > stored.size() || (expected != unknownSize && size != expected))
    {
      throw Damaged(what);
    }
    return std::string(stored.substr(0, size));
  }

  // Number of blocks, size of a block, size of the last one where it is smaller (else 0), compressed size of
  // each; then the blocks.
  std::string Inflate(std::string_view stored, const std::string& what, std::uint64_t expected) const
  {
    const std::uint64_t blocks = TakeHeader(stored, what);
    if (blocks == 0)
    {
      if (expected != unknownSize && expected != 0)
      {
        throw Damaged(what);
      }
      return {};
    }
    const std::uint64_t blockSize = TakeHeader(stored, what);
    const std::uint64_t lastSize = TakeHeader(stored, what);
    if (blocks > stored.size() / headerBytes_ || blockSize > largestFile || lastSize > blockSize)
    {
      throw Damaged(what);
    }
    const std::uint64_t total = lastSize ? (blocks - 1) * blockSize + lastSize : blocks * blockSize;
    if (total > stored.size() * deflateLimit || (expected != unknownSize && total != expected))
    {
      throw Damaged(what);
    }
    std::vector<std::uint64_t> sizes;
    for (std::uint64_t block = 0; block < blocks; ++block)
    {
      sizes.push_back(TakeHeader(stored, what));
    }
    std::string bytes(total, '\0');
    std::uint64_t done = 0;
    for (const std::uint64_t size : sizes)
    {
      auto room = static_cast<uLongf>(std::min(blockSize, total - done));
      const uLongf wanted = room;
      if (size > stored.size() ||
          uncompress(reinterpret_cast<Bytef*>(bytes.data()) + done, &room,
                     reinterpret_cast<const Bytef*>(stored.data()), static_cast<uLong>(size)) != Z_OK ||
          room != wanted)
      {
        throw Damaged(what);
      }
      stored.remove_prefix(size);
      done += room;
    }
    return bytes;
  }

  std::string name_;
  std::string text_;
  pugi::xml_document document_;
  pugi::xml_node polyData_;
  pugi::xml_node piece_;
  std::string_view appended_;
  bool appendedIsRaw_ = false;
  bool compressed_ = false;
  bool swap_ = false;
  std::size_t headerBytes_ = 4;
  std::int64_t points_ = 0;
};

}  // namespace

StoredField ReadVtp(const std::string& fileName)
{
  vtkNew<vtkPolyData> polyData;
  VtpFile(fileName).Fill(polyData);
  return FieldFromPolyData(polyData, fileName);
}

}  // namespace bigus
