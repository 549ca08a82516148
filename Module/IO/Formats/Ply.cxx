// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>

#include "Data/FieldShape.h"
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
constexpr std::int64_t kMostVertices = 1000000000;
constexpr const char* kPoseElement = "view_pose";
constexpr std::size_t kPoseNumbers = 12;  // of the upper three rows

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

struct Element
{
  std::int64_t count = -1;  // -1: not there
  std::vector<Property> properties;
  std::size_t stride = 0;  // bytes of a binary one
};

struct PlyHeader
{
  Layout layout = Layout::Ascii;
  bool hasFormat = false;
  Element vertices, poses;  // poses: of recorded planes (ViewDependence), right behind the vertices
  std::vector<std::string> elements;
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

/// The element that a header line begins: vertex, ours behind it, or null where nothing is read of it.
Element* BeginElement(const InputFile& input, const std::string& line, PlyHeader& header)
{
  const auto refuse = [&](const std::string& message) { return FormatError(input.Name() + ": " + message); };
  const auto words = Words(line);
  const bool isVertex = words[1] == "vertex", isPose = words[1] == kPoseElement;
  header.elements.emplace_back(words[1]);
  if (!isVertex && header.vertices.count < 0)
  {
    throw refuse("element " + Quoted(words[1]) + " comes before vertex; vertex must be the first element");
  }
  if (!isVertex && !isPose)
  {
    return nullptr;
  }
  Element& element = isVertex ? header.vertices : header.poses;
  const std::int64_t most = isVertex ? kMostVertices : static_cast<std::int64_t>(RecordedViews::kMostPoses);
  std::int64_t count = -1;
  if (!ParseNumber(words[2], count) || count < 0 || count > most || element.count >= 0)
  {
    throw refuse("header line " + Quoted(line) + "; one " + std::string(words[1]) + " element with 0 to " +
                 std::to_string(most) + (isVertex ? " vertices" : "") + " is expected");
  }
  if (isPose && header.elements.size() != 2)
  {
    throw refuse("element " + Quoted(words[1]) + " does not follow vertex");
  }
  element.count = count;
  return &element;
}

/// Takes one line of a header. `element`: that it belongs to, or null.
void TakeHeaderLine(const InputFile& input, const std::string& line, PlyHeader& header, Element*& element)
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
    element = BeginElement(input, line, header);
  }
  else if (keyword == "property")
  {
    Property property;
    if (element && (words.size() != 3 || !ParseType(std::string(words[1]), property) ||
                    element->properties.size() >= kMostProperties))
    {
      throw refuse("header line " + Quoted(line) + "; a " + header.elements.back() + " has up to " +
                   std::to_string(kMostProperties) + " properties of a number type and no lists");
    }
    if (element)
    {
      property.name = words[2];
      element->stride += property.bytes;
      element->properties.push_back(property);
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
  RequireFormat(input.ReadLine(line) && line == "ply", input.Name(), ": does not begin with the line \"ply\"");
  Element* element = nullptr;
  while (input.ReadLine(line))
  {
    RequireFormat(input.Position() <= longestPlyHeader, input.Name(), ": the header is longer than 1 MiB");
    const auto words = Words(line);
    if (!words.empty() && words[0] == "end_header")
    {
      RequireFormat(header.hasFormat && header.vertices.count >= 0, input.Name(),
                    ": the header has no format or no vertex element");
      return header;
    }
    TakeHeaderLine(input, line, header, element);
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

// A number of a binary element, its bytes already in this machine's order.
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

// Reads one element after the other into `values`, [properties].
class ElementReader
{
public:
  /// `name`, `plural`: what one is called, and several.
  ElementReader(InputFile& input, Layout layout, const Element& element, const char* name, const char* plural)
      : input_(input), layout_(layout), element_(element), name_(name), plural_(plural), bytes_(element.stride)
  {
    // The least room one takes: its bytes, or a digit and a blank for each number.
    const std::uint64_t least = layout == Layout::Ascii ? 2 * element.properties.size() : element.stride;
    const auto count = static_cast<std::uint64_t>(element.count);
    if (count > 0 && (least == 0 || (input.Remaining() + 1) / least < count))
    {
      throw TruncationError(input.Name() + ": claims " + std::to_string(element.count) + " " + plural + ", but only " +
                            std::to_string(input.Remaining()) + " bytes follow; the file is truncated");
    }
  }

  void Read(std::vector<double>& values)
  {
    values.resize(element_.properties.size());
    if (layout_ == Layout::Ascii)
    {
      if (!input_.ReadLine(line_))
      {
        throw Truncated();
      }
      RequireFormat(ParseNumbers(line_, values.size(), values.data()), input_.Name(), ": ", name_, " ", done_,
                    " is not ", values.size(), " numbers");
    }
    else
    {
      if (input_.Read(bytes_.data(), bytes_.size()) != bytes_.size())
      {
        throw Truncated();
      }
      const bool swap = kThisMachineIsBigEndian != (layout_ == Layout::Big);
      unsigned char* at = bytes_.data();
      for (std::size_t p = 0; p < values.size(); ++p)
      {
        const Property& property = element_.properties[p];
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
  FileError Truncated() const
  {
    return TruncationError(input_.Name() + ": ends after " + std::to_string(done_) + " " + plural_ +
                           "; it is truncated");
  }

  InputFile& input_;
  Layout layout_;
  const Element& element_;
  std::string name_, plural_;
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

/// The numbers in which a comment ends.
template <int kCount>
Eigen::Matrix<double, kCount, 1> ParseVector(const std::string& fileName, const std::string& comment,
                                             const std::string& value)
{
  Eigen::Matrix<double, kCount, 1> numbers;
  RequireFormat(ParseNumbers(value, kCount, numbers.data()), fileName, ": the comment ", Quoted(comment),
                " does not end in ", kCount, " numbers");
  return numbers;
}

void ReadComments(const std::string& fileName, const PlyHeader& header, StoredField& ply)
{
  std::string value;
  for (const std::string& comment : header.comments)
  {
    const auto number = [&]
    {
      double parsed = 0;
      RequireFormat(ParseNumber(value, parsed), fileName, ": the comment ", Quoted(comment),
                    " does not end in a number");
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
      ply.field.beam.trainedNormals.emplace_back(ParseVector<3>(fileName, comment, value));
    }
    if (OwnComment(comment, "view_version", value))
    {
      RequireViewVersion("Gaussian field", number());
      ply.view.emplace();
    }
    if (OwnComment(comment, "view_mean", value) && ply.view)
    {
      const Eigen::Matrix<double, 9, 1> rows = ParseVector<9>(fileName, comment, value);
      ply.view->views.mean = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
    }
    if (OwnComment(comment, "view_steps", value) && ply.view)
    {
      const Eigen::Vector3d steps = ParseVector<3>(fileName, comment, value);
      ply.view->views.unit = steps[0];
      ply.view->views.angleStep = steps[1];
      ply.view->views.elevationStep = steps[2];
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
  std::array<std::size_t, 3> view = {0, 0, 0};
  bool isOwn;  // has the reflectivity; else it follows from colour and opacity
  std::size_t reflectivity;

  Columns(const std::string& fileName, const PlyHeader& header, bool hasView)
  {
    std::map<std::string, std::size_t> columns;
    for (std::size_t p = 0; p < header.vertices.properties.size(); ++p)
    {
      columns.emplace(header.vertices.properties[p].name, p);
    }
    const auto column = [&](const char* name)
    {
      const auto found = columns.find(name);
      RequireFormat(found != columns.end(), fileName, ": the vertex property ", name,
                    " is missing; this is not a Gaussian field");
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
    if (hasView)
    {
      view = {column("view_0"), column("view_1"), column("view_2")};
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

std::string Joined(const double* numbers, std::size_t count)
{
  std::string text;
  for (std::size_t k = 0; k < count; ++k)
  {
    text += " " + ExactNumber(numbers[k]);
  }
  return text;
}

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
    header += "comment bigus.trained_normal" + Joined(normal.data(), 3) + "\n";
  }
  if (ply.view)
  {
    const RecordedViews& views = ply.view->views;
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> mean = views.mean;
    const Eigen::Vector3d steps(views.unit, views.angleStep, views.elevationStep);
    header += "comment bigus.view_version " + std::to_string(kViewVersion) + "\ncomment bigus.view_mean" +
              Joined(mean.data(), 9) + "\ncomment bigus.view_steps" + Joined(steps.data(), 3) + "\n";
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
  header += "property double reflectivity\n";
  if (ply.view)
  {
    header += "property double view_0\nproperty double view_1\nproperty double view_2\n";
    header += std::string("element ") + kPoseElement + " " + std::to_string(ply.view->views.poses.size()) + "\n";
    for (std::size_t k = 0; k < kPoseNumbers; ++k)
    {
      header += "property double m" + std::to_string(k / 4) + std::to_string(k % 4) + "\n";
    }
  }
  return header + "end_header\n";
}

/// Appends numbers to bytes in the file's order.
class Numbers
{
public:
  template <class Number>
  void Put(Number number)
  {
    unsigned char raw[sizeof(number)];
    std::memcpy(raw, &number, sizeof(number));
    if (kThisMachineIsBigEndian)
    {
      SwapBytes(raw, sizeof(number), sizeof(number));
    }
    bytes_.insert(bytes_.end(), raw, raw + sizeof(number));
  }

  void WriteTo(AtomicFile& file)
  {
    file.Write(bytes_.data(), bytes_.size());
    bytes_.clear();
  }

private:
  std::vector<unsigned char> bytes_;
};

/// A vertex. What viewers show grows with |r|: grey and opacity, the strongest being white and nearly opaque.
void PutVertex(const GaussianField& field, std::size_t i, double strongest, Numbers& to)
{
  const double grey = strongest > 0 ? std::abs(field.reflectivities[i]) / strongest : 0;
  const double alpha = std::min(std::max(grey, 0.01), 0.99);
  const Eigen::Vector4d rotation = field.rotations[i].stableNormalized();
  for (int axis = 0; axis < 3; ++axis)
  {
    const auto position = static_cast<float>(field.means[i][axis]);
    if (!std::isfinite(position))
    {
      throw FileError(FileFault::User, "point " + std::to_string(i) + " lies at " + ExactNumber(field.means[i][axis]) +
                                           " mm, which is more than a PLY file for viewers can hold");
    }
    to.Put(position);
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    to.Put(0.0f);  // the normal
  }
  for (int c = 0; c < 3; ++c)
  {
    to.Put(static_cast<float>((grey - 0.5) / sphericalHarmonic0));
  }
  to.Put(static_cast<float>(std::log(alpha / (1 - alpha))));
  for (int axis = 0; axis < 3; ++axis)
  {
    to.Put(static_cast<float>(std::log(field.scales[i][axis])));
  }
  for (int c = 0; c < 4; ++c)
  {
    to.Put(static_cast<float>(rotation[c]));
  }
  to.Put(field.reflectivities[i]);
}

/// Of recorded planes, behind the vertices.
std::vector<Eigen::Matrix4d> ReadPoses(InputFile& input, const PlyHeader& header)
{
  RequireFormat(header.poses.count >= 0 && header.poses.properties.size() == kPoseNumbers, input.Name(),
                ": the comment \"bigus.view_version\" needs an element ", kPoseElement, " with ", kPoseNumbers,
                " properties behind the vertices");
  ElementReader reader(input, header.layout, header.poses, "recorded pose", "recorded poses");
  std::vector<Eigen::Matrix4d> poses(static_cast<std::size_t>(header.poses.count), Eigen::Matrix4d::Identity());
  std::vector<double> values;
  for (Eigen::Matrix4d& pose : poses)
  {
    reader.Read(values);
    pose.topRows<3>() = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(values.data());
  }
  return poses;
}

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
  if (header.vertices.count == 0)
  {
    ply.view.reset();
    return ply;
  }
  const Columns columns(fileName, header, ply.view.has_value());
  ElementReader reader(input, header.layout, header.vertices, "vertex", "vertices");
  field.Resize(static_cast<std::size_t>(header.vertices.count));
  if (ply.view)
  {
    ply.view->terms.resize(field.Size());
  }
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
    for (int axis = 0; axis < 3 && ply.view; ++axis)
    {
      ply.view->terms[i][axis] = values[columns.view[axis]];
    }
  }
  if (ply.view)
  {
    ply.view->views.poses = ReadPoses(input, header);
  }
  return ply;
}

void WritePly(const StoredField& ply, AtomicFile& file)
{
  const GaussianField& field = ply.field;
  file.Write(HeaderOf(ply));
  Numbers numbers;
  double strongest = 0;
  for (const double r : field.reflectivities)
  {
    strongest = std::max(strongest, std::abs(r));
  }
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    PutVertex(field, i, strongest, numbers);
    for (int axis = 0; axis < 3 && ply.view; ++axis)
    {
      numbers.Put(ply.view->terms[i][axis]);
    }
    numbers.WriteTo(file);
  }
  for (std::size_t k = 0; ply.view && k < ply.view->views.poses.size(); ++k)
  {
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> pose = ply.view->views.poses[k].topRows<3>();
    std::for_each(pose.data(), pose.data() + pose.size(), [&](double number) { numbers.Put(number); });
    numbers.WriteTo(file);
  }
}

}  // namespace bigus
