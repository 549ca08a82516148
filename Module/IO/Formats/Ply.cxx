// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>

#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

constexpr double sphericalHarmonic0 = 0.28209479177387814;  // 1 / (2 sqrt(pi)): colour = 0.5 + this * f_dc
constexpr std::uint64_t longestPlyHeader = 1u << 20;
constexpr std::size_t kMostProperties = 1000;
constexpr std::int64_t mostVertices = 1000000000;

enum class Layout
{
  Ascii,
  Little,
  Big
};

struct Property
{
  std::string name;
  char kind;  // 'i' signed, 'u' unsigned, 'f' floating
  std::size_t bytes;
};

struct PlyHeader
{
  Layout layout = Layout::Ascii;
  std::int64_t vertices = -1;
  bool hasFormat = false;
  std::vector<Property> properties;  // of a vertex
  std::size_t stride = 0;            // bytes of a binary vertex
  std::vector<std::string> comments;
};

bool ParseType(const std::string& text, Property& property)
{
  static const std::map<std::string, std::pair<char, std::size_t>> types = {
      {"char", {'i', 1}},  {"int8", {'i', 1}},    {"uchar", {'u', 1}},  {"uint8", {'u', 1}},
      {"short", {'i', 2}}, {"int16", {'i', 2}},   {"ushort", {'u', 2}}, {"uint16", {'u', 2}},
      {"int", {'i', 4}},   {"int32", {'i', 4}},   {"uint", {'u', 4}},   {"uint32", {'u', 4}},
      {"float", {'f', 4}}, {"float32", {'f', 4}}, {"double", {'f', 8}}, {"float64", {'f', 8}}};
  const auto found = types.find(text);
  if (found != types.end())
  {
    property.kind = found->second.first;
    property.bytes = found->second.second;
  }
  return found != types.end();
}

/// Takes one line of a header. `inVertex`: it belongs to the element vertex.
void TakeHeaderLine(const InputFile& input, const std::string& line, PlyHeader& header, bool& inVertex)
{
  const auto refuse = [&](const std::string& message) { return FormatError(input.Name() + ": " + message); };
  const auto words = Words(line);
  const std::string keyword = words.empty() ? "" : std::string(words[0]);
  if (keyword == "comment" || keyword == "obj_info")
  {
    header.comments.emplace_back(Trimmed(std::string_view(line).substr(keyword.size())));
  }
  else if (keyword == "format" && words.size() == 3 && words[2] == "1.0" &&
           (words[1] == "ascii" || words[1] == "binary_little_endian" || words[1] == "binary_big_endian"))
  {
    header.layout = words[1] == "ascii"                  ? Layout::Ascii
                    : words[1] == "binary_little_endian" ? Layout::Little
                                                         : Layout::Big;
    header.hasFormat = true;
  }
  else if (keyword == "element" && words.size() == 3)
  {
    inVertex = words[1] == "vertex";
    if (!inVertex && header.vertices < 0)
    {
      throw refuse("element " + Quoted(words[1]) + " comes before vertex; vertex must be the first element");
    }
    std::int64_t count = -1;
    if (inVertex && (!ParseNumber(words[2], count) || count < 0 || count > mostVertices || header.vertices >= 0))
    {
      throw refuse("header line " + Quoted(line) + "; one vertex element with 0 to " + std::to_string(mostVertices) +
                   " vertices is expected");
    }
    header.vertices = inVertex ? count : header.vertices;
  }
  else if (keyword == "property")
  {
    Property property;
    if (inVertex && (words.size() != 3 || !ParseType(std::string(words[1]), property) ||
                     header.properties.size() >= kMostProperties))
    {
      throw refuse("header line " + Quoted(line) + "; a vertex has up to " + std::to_string(kMostProperties) +
                   " properties of a number type and no lists");
    }
    if (inVertex)
    {
      property.name = words[2];
      header.stride += property.bytes;
      header.properties.push_back(property);
    }
  }
  else
  {
    throw refuse("header line " + Quoted(line) + " is not PLY 1.0");
  }
}

PlyHeader ReadHeader(InputFile& input)
{
  PlyHeader header;
  std::string line;
  if (!input.ReadLine(line) || line != "ply")
  {
    throw FormatError(input.Name() + ": does not begin with the line \"ply\"");
  }
  bool inVertex = false;
  while (input.ReadLine(line))
  {
    if (input.Position() > longestPlyHeader)
    {
      throw FormatError(input.Name() + ": the header is longer than 1 MiB");
    }
    const auto words = Words(line);
    if (!words.empty() && words[0] == "end_header")
    {
      if (!header.hasFormat || header.vertices < 0)
      {
        throw FormatError(input.Name() + ": the header has no format or no vertex element");
      }
      return header;
    }
    TakeHeaderLine(input, line, header, inVertex);
  }
  throw TruncationError(input.Name() + ": the header ends before end_header; the file is truncated");
}

template <class Number>
double As(const unsigned char* bytes)
{
  Number number;
  std::memcpy(&number, bytes, sizeof(number));
  return static_cast<double>(number);
}

// A number of a binary vertex, its bytes already in this machine's order.
double Decode(const Property& property, const unsigned char* bytes)
{
  switch (property.kind)
  {
    case 'i':
      return property.bytes == 1   ? As<std::int8_t>(bytes)
             : property.bytes == 2 ? As<std::int16_t>(bytes)
                                   : As<std::int32_t>(bytes);
    case 'u':
      return property.bytes == 1   ? As<std::uint8_t>(bytes)
             : property.bytes == 2 ? As<std::uint16_t>(bytes)
                                   : As<std::uint32_t>(bytes);
    default:
      return property.bytes == 4 ? As<float>(bytes) : As<double>(bytes);
  }
}

// Reads vertex after vertex into `values`, [properties].
class VertexReader
{
public:
  VertexReader(InputFile& input, const PlyHeader& header) : input_(input), header_(header), bytes_(header.stride)
  {
    // The least room a vertex takes: its bytes, or a digit and a blank for each number.
    const std::uint64_t least = header.layout == Layout::Ascii ? 2 * header.properties.size() : header.stride;
    const auto vertices = static_cast<std::uint64_t>(header.vertices);
    if (vertices > 0 && (least == 0 || (input.Remaining() + 1) / least < vertices))
    {
      throw TruncationError(input.Name() + ": claims " + std::to_string(header.vertices) + " vertices, but only " +
                            std::to_string(input.Remaining()) + " bytes follow; the file is truncated");
    }
  }

  void Read(std::vector<double>& values)
  {
    values.resize(header_.properties.size());
    if (header_.layout == Layout::Ascii)
    {
      if (!input_.ReadLine(line_))
      {
        throw TruncationError(input_.Name() + ": ends after " + std::to_string(done_) + " vertices; it is truncated");
      }
      if (!ParseNumbers(line_, values.size(), values.data()))
      {
        throw FormatError(input_.Name() + ": vertex " + std::to_string(done_) + " is not " +
                          std::to_string(values.size()) + " numbers");
      }
    }
    else
    {
      if (input_.Read(bytes_.data(), bytes_.size()) != bytes_.size())
      {
        throw TruncationError(input_.Name() + ": ends after " + std::to_string(done_) + " vertices; it is truncated");
      }
      const bool swap = kThisMachineIsBigEndian != (header_.layout == Layout::Big);
      unsigned char* at = bytes_.data();
      for (std::size_t p = 0; p < values.size(); ++p)
      {
        const Property& property = header_.properties[p];
        if (swap)
        {
          SwapBytes(at, property.bytes, property.bytes);
        }
        values[p] = Decode(property, at);
        at += property.bytes;
      }
    }
    ++done_;
  }

private:
  InputFile& input_;
  const PlyHeader& header_;
  std::vector<unsigned char> bytes_;
  std::string line_;
  std::int64_t done_ = 0;
};

// Our own comment lines: "bigus.<key> <value>".
bool OwnComment(const std::string& comment, const std::string& key, std::string& value)
{
  const std::string start = "bigus." + key + " ";
  if (comment.compare(0, start.size(), start) != 0)
  {
    return false;
  }
  value = comment.substr(start.size());
  return true;
}

Eigen::Vector3d ParseNormal(const std::string& fileName, const std::string& comment, const std::string& value)
{
  Eigen::Vector3d normal;
  if (!ParseNumbers(value, 3, normal.data()))
  {
    throw FormatError(fileName + ": the comment " + Quoted(comment) + " does not end in three numbers");
  }
  return normal;
}

void ReadComments(const std::string& fileName, const PlyHeader& header, StoredField& ply)
{
  std::string value;
  for (const std::string& comment : header.comments)
  {
    const auto number = [&]
    {
      double parsed = 0;
      if (!ParseNumber(value, parsed))
      {
        throw FormatError(fileName + ": the comment " + Quoted(comment) + " does not end in a number");
      }
      return parsed;
    };
    if (OwnComment(comment, "format_version", value) && number() != 1)
    {
      throw FormatError(fileName + ": format version " + Quoted(value) + "; this program reads 1");
    }
    if (OwnComment(comment, "gamma", value))
    {
      ply.field.transfer.gamma = number();
    }
    if (OwnComment(comment, "elevation_sigma", value))
    {
      ply.field.beam.elevationSigma = number();
    }
    if (OwnComment(comment, "probe_elevation_sigma", value))
    {
      ply.field.beam.probeElevationSigma = number();
    }
    if (OwnComment(comment, "trained_normal", value))
    {
      ply.field.beam.trainedNormals.push_back(ParseNormal(fileName, comment, value));
    }
    if (OwnComment(comment, "provenance", value))
    {
      ply.provenance.push_back(value);
    }
  }
}

/// Which properties of a vertex are read.
struct Columns
{
  std::array<std::size_t, 3> mean, scale, colour = {0, 0, 0};
  std::array<std::size_t, 4> rotation;
  bool isOwn;  // has the reflectivity; else it follows from colour and opacity
  std::size_t reflectivity;

  Columns(const std::string& fileName, const PlyHeader& header)
  {
    std::map<std::string, std::size_t> columns;
    for (std::size_t p = 0; p < header.properties.size(); ++p)
    {
      columns.emplace(header.properties[p].name, p);
    }
    const auto column = [&](const char* name)
    {
      const auto found = columns.find(name);
      if (found == columns.end())
      {
        throw FormatError(fileName + ": the vertex property " + name + " is missing; this is not a Gaussian field");
      }
      return found->second;
    };
    mean = {column("x"), column("y"), column("z")};
    scale = {column("scale_0"), column("scale_1"), column("scale_2")};
    rotation = {column("rot_0"), column("rot_1"), column("rot_2"), column("rot_3")};
    isOwn = columns.count("reflectivity") != 0;
    reflectivity = isOwn ? column("reflectivity") : column("opacity");
    if (!isOwn)
    {
      colour = {column("f_dc_0"), column("f_dc_1"), column("f_dc_2")};
    }
  }

  double Reflectivity(const std::vector<double>& values) const
  {
    if (isOwn)
    {
      return values[reflectivity];
    }
    const double luminance = 0.5 + sphericalHarmonic0 * (0.2126 * values[colour[0]] + 0.7152 * values[colour[1]] +
                                                         0.0722 * values[colour[2]]);
    const double alpha = 1.0 / (1.0 + std::exp(-values[reflectivity]));
    // Written so that NaN stays NaN and is refused by Validate.
    return alpha * (luminance < 0 ? 0 : luminance > 1 ? 1 : luminance);
  }
};

std::string HeaderOf(const StoredField& ply)
{
  const GaussianField& field = ply.field;
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  header += "comment Signed 3-D Gaussians of an ultrasound sweep, positions and scales in mm\n";
  header += "comment bigus.format_version 1\n";
  header += "comment bigus.gamma " + ExactNumber(field.transfer.gamma) + "\n";
  header += "comment bigus.elevation_sigma " + ExactNumber(field.beam.elevationSigma) + "\n";
  if (field.beam.probeElevationSigma > 0)
  {
    header += "comment bigus.probe_elevation_sigma " + ExactNumber(field.beam.probeElevationSigma) + "\n";
  }
  for (const Eigen::Vector3d& normal : field.beam.trainedNormals)
  {
    header += "comment bigus.trained_normal " + ExactNumber(normal[0]) + " " + ExactNumber(normal[1]) + " " +
              ExactNumber(normal[2]) + "\n";
  }
  for (std::string line : ply.provenance)
  {
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
    header += "comment bigus.provenance " + line + "\n";
  }
  header += "element vertex " + std::to_string(field.Size()) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
  {
    header += std::string("property float ") + name + "\n";
  }
  return header + "property double reflectivity\nend_header\n";
}

/// A vertex in the file's order of bytes. What viewers show grows with |r|: grey and opacity, the strongest being white
/// and nearly opaque.
class VertexBytes
{
public:
  VertexBytes(const GaussianField& field, std::size_t i, double strongest)
  {
    const double grey = strongest > 0 ? std::abs(field.reflectivities[i]) / strongest : 0;
    const double alpha = std::min(std::max(grey, 0.01), 0.99);
    const Eigen::Vector4d rotation = field.rotations[i].stableNormalized();
    for (int axis = 0; axis < 3; ++axis)
    {
      const auto position = static_cast<float>(field.means[i][axis]);
      if (!std::isfinite(position))
      {
        throw FileError(FileFault::User, "point " + std::to_string(i) + " lies at " +
                                             ExactNumber(field.means[i][axis]) +
                                             " mm, which is more than a PLY file for viewers can hold");
      }
      Put(position);
    }
    for (int axis = 0; axis < 3; ++axis)
    {
      Put(0.0f);  // the normal
    }
    for (int c = 0; c < 3; ++c)
    {
      Put(static_cast<float>((grey - 0.5) / sphericalHarmonic0));
    }
    Put(static_cast<float>(std::log(alpha / (1 - alpha))));
    for (int axis = 0; axis < 3; ++axis)
    {
      Put(static_cast<float>(std::log(field.scales[i][axis])));
    }
    for (int c = 0; c < 4; ++c)
    {
      Put(static_cast<float>(rotation[c]));
    }
    Put(field.reflectivities[i]);
  }

  unsigned char bytes[17 * sizeof(float) + sizeof(double)];

private:
  template <class Number>
  void Put(Number number)
  {
    std::memcpy(at_, &number, sizeof(number));
    if (kThisMachineIsBigEndian)
    {
      SwapBytes(at_, sizeof(number), sizeof(number));
    }
    at_ += sizeof(number);
  }

  unsigned char* at_ = bytes;
};

}  // namespace

StoredField ReadPly(const std::string& fileName)
{
  InputFile input(fileName);
  const PlyHeader header = ReadHeader(input);
  StoredField ply;
  GaussianField& field = ply.field;
  field.transfer.gamma = 1.0;
  field.beam.elevationSigma = 0.0;
  ReadComments(fileName, header, ply);
  if (header.vertices == 0)
  {
    return ply;
  }
  const Columns columns(fileName, header);
  VertexReader reader(input, header);
  field.Resize(static_cast<std::size_t>(header.vertices));
  std::vector<double> values;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    reader.Read(values);
    for (int axis = 0; axis < 3; ++axis)
    {
      field.means[i][axis] = values[columns.mean[axis]];
      field.scales[i][axis] = std::exp(values[columns.scale[axis]]);
    }
    for (int c = 0; c < 4; ++c)
    {
      field.rotations[i][c] = values[columns.rotation[c]];
    }
    field.reflectivities[i] = columns.Reflectivity(values);
  }
  return ply;
}

void WritePly(const StoredField& ply, AtomicFile& file)
{
  const GaussianField& field = ply.field;
  file.Write(HeaderOf(ply));
  double strongest = 0;
  for (const double r : field.reflectivities)
  {
    strongest = std::max(strongest, std::abs(r));
  }
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    const VertexBytes vertex(field, i, strongest);
    file.Write(vertex.bytes, sizeof(vertex.bytes));
  }
}

}  // namespace bigus
