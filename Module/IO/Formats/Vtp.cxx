// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Vtp.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <numeric>
#include <string_view>
#include <vector>

#include "Data/FieldShape.h"
#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/Formats/Xml.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

// Of a file that is read by pieces, never as a whole; and of its XML, or the whole of a file in another encoding than ours.
constexpr std::uint64_t largestVtp = std::uint64_t(256) << 30;
constexpr std::uint64_t largestText = std::uint64_t(4) << 30;
constexpr std::int64_t mostPoints = 1000000000;
constexpr std::int64_t mostComponents = 255;
// Of the provenance. Every string costs 32 bytes in memory, however short it is, so their number needs a bound of its own.
constexpr std::uint64_t mostTextBytes = 1u << 20;
constexpr std::int64_t mostStrings = 10000;
constexpr std::uint64_t mostStandardError = std::uint64_t(256) << 20;  // bytes; a training writes some 10 MB at most

// How errors about arrays begin.
constexpr const char* kOwner = "Gaussian field";

// The arrays of a field: where each is, and what it holds as we write it, Float32 in place of Float64 where that
// holds every value.
struct ArrayName
{
  const char* parent;
  const char* name;
  const char* ownType;
};
constexpr ArrayName kArrays[] = {
    {"PointData", "Scale", "Float64"},          {"PointData", "Rotation", "Float64"},
    {"PointData", "Reflectivity", "Float64"},   {"PointData", "ViewTerm", "Float64"},
    {"FieldData", "ViewVersion", "Int32"},      {"FieldData", "ViewMean", "Float64"},
    {"FieldData", "ViewSteps", "Float64"},      {"FieldData", "ViewPoses", "Float64"},
    {"PointData", "LabelWeight", "Float32"},    {"FieldData", "LabelNames", "String"},
    {"FieldData", "LabelValues", "Int32"},      {"FieldData", "LabelColors", "Float64"},
    {"FieldData", "LabelPoints", "Float64"},    {"FieldData", "LabelPointWeight", "Float32"},
    {"FieldData", "Gamma", "Float64"},          {"FieldData", "ElevationSigma", "Float64"},
    {"FieldData", "FormatVersion", "Int32"},    {"FieldData", "ProbeElevationSigma", "Float64"},
    {"FieldData", "TrainedNormals", "Float64"}, {"FieldData", "Provenance", "String"},
    {"FieldData", "StandardError", "UInt8"}};

bool IsOneOf(const std::string& text, std::initializer_list<const char*> known)
{
  return std::find(known.begin(), known.end(), text) != known.end();
}

class VtpFile
{
public:
  explicit VtpFile(const std::string& fileName) : name_(fileName), file_(fileName)
  {
    RequireFormat(file_.Size() <= largestVtp, name_, ": has ", file_.Size(), " bytes; ", largestVtp,
                  " are read. Split it into the pieces of a .pvtp");
    const std::uint64_t tailBegin = file_.Size() - std::min<std::uint64_t>(file_.Size(), kTail);
    const std::string tail = BytesAt(tailBegin, kTail);
    Require(FileFault::Truncated,
            tail.find("</VTKFile>", tail.size() - std::min<std::size_t>(tail.size(), 64)) != std::string::npos, name_,
            ": does not end with </VTKFile>; the file is truncated");
    // What follows <AppendedData ...> _ is not XML, and is not read before it is needed.
    std::string text;
    std::size_t appended = std::string::npos, begin = std::string::npos;
    while (begin == std::string::npos && text.size() < file_.Size())
    {
      RequireFormat(text.size() <= largestText, name_, ": has more than ", largestText, " bytes of XML");
      const std::size_t known = text.size() - std::min<std::size_t>(text.size(), 16);  // the tag may be cut in two
      text += BytesAt(text.size(), kTextAtOnce);
      appended = appended == std::string::npos ? text.find("<AppendedData", known) : appended;
      begin = appended == std::string::npos ? appended : text.find('_', appended);
      if (appended != std::string::npos && begin == std::string::npos && text.size() - appended > kTextAtOnce)
      {
        throw Damaged("the appended data");
      }
    }
    bool raw = false;
    if (appended != std::string::npos)
    {
      const std::size_t endInTail = tail.rfind("</AppendedData>");
      RequireSound(begin != std::string::npos && endInTail != std::string::npos && tailBegin + endInTail > begin,
                   "the appended data");
      const std::string tag = text.substr(appended, begin - appended);
      raw = tag.find("encoding=\"raw\"") != std::string::npos;
      if (!raw && tag.find("encoding=\"base64\"") == std::string::npos)
      {
        throw Damaged("the encoding of the appended data");
      }
      appendedBegin_ = begin + 1;
      appendedSize_ = tailBegin + endInTail - appendedBegin_;
      text.resize(appended);
      text += "</VTKFile>";
    }
    document_ = ParseXml(text, name_ + ": not valid XML");
    root_ = document_.document_element();
    RequireFormat(
        root_.name() == std::string_view("VTKFile") && root_.attribute("type").value() == std::string_view("PolyData"),
        name_, ": not a VTK XML PolyData file");
    polyData_ = root_.child("PolyData");
    piece_ = polyData_.child("Piece");
    RequireFormat(piece_ && !piece_.next_sibling("Piece"), name_, ": must have one Piece");
    const std::string points = piece_.attribute("NumberOfPoints").value();
    RequireFormat(ParseNumber(points, points_) && points_ >= 0 && points_ <= mostPoints &&
                      static_cast<std::uint64_t>(points_) <= file_.Size() * deflateLimit,
                  name_, ": NumberOfPoints is ", Quoted(points), "; 0 to ", mostPoints,
                  " are read, and no more than the file can hold");
    FindEncoding(raw);
    if (!ours_)
    {
      RequireSizes(root_);
    }
  }

  /// Whether the file is encoded as we write it, so that Field can read it.
  bool IsOurs() const { return ours_; }

  /// Of the Gaussians those of `chunks`, one chunk after the other, and the chunks' sizes; all of them where it is null.
  StoredField Field(FieldChunks* chunks)
  {
    StoredField stored;
    Choose(chunks);
    GaussianField& field = stored.field;
    const bool required = points_ > 0;
    if (Node("FormatVersion"))
    {
      RequireFieldFormatVersion(kOwner, ReadVersion("FormatVersion"));
    }
    ReadScalar("Gamma", required, field.transfer.gamma);
    ReadScalar("ElevationSigma", required, field.beam.elevationSigma);
    ReadScalar("ProbeElevationSigma", false, field.beam.probeElevationSigma);
    if (const pugi::xml_node node = Node("TrainedNormals"))
    {
      const FoundArray normals = Find(node, "TrainedNormals", 1);
      RequireFewTrainedNormals(kOwner, normals.tuples);
      ReadVectors(normals, Whole(normals.tuples), field.beam.trainedNormals);
    }
    if (required)
    {
      const FoundArray points = Find(PointsNode(), "Points", points_);
      RequireFormat(points.components == 3 && points.tuples == points_, name_, ": Points must have 3 components and ",
                    points_, " tuples");
      ReadVectors(points, wanted_, field.means);
      ReadVectors(FindOfPoints("Scale", 3), wanted_, field.scales);
      ReadVectors(FindOfPoints("Rotation", 4), wanted_, field.rotations);
      const FoundArray reflectivities = FindOfPoints("Reflectivity", 1);
      RequireArrayShape(kOwner, reflectivities.name, reflectivities.components, reflectivities.tuples, 1, points_);
      field.reflectivities.resize(Count(wanted_));
      ReadDoubles(reflectivities, wanted_, field.reflectivities.data());
    }
    if (Node("ViewTerm"))
    {
      stored.view = ReadView();
    }
    if (!chunks && Node("LabelWeight"))
    {
      stored.labels = ReadLabels();
    }
    if (const pugi::xml_node node = Node("Provenance"))
    {
      ReadStrings(node, "Provenance", stored.provenance);
    }
    if (const pugi::xml_node node = Node("StandardError"))
    {
      const FoundArray found = {"StandardError", 0, 1, false, FindBlocks(node, "StandardError")};
      RequireFormat(found.blocks.total <= mostStandardError, name_, ": StandardError has ", found.blocks.total,
                    " bytes; ", mostStandardError, " are read");
      stored.standardError.resize(static_cast<std::size_t>(found.blocks.total));
      Inflate(found, Whole(static_cast<std::int64_t>(found.blocks.total)), 1, stored.standardError.data());
    }
    return stored;
  }

private:
  static constexpr std::uint64_t kTail = 4096;             // bytes in which the appended data end
  static constexpr std::uint64_t kTextAtOnce = 64 * 1024;  // bytes of XML

  // The blocks of one compressed array.
  struct Blocks
  {
    std::vector<std::uint64_t> sizes;  // compressed bytes of each
    std::uint64_t blockSize = 0;       // bytes of each but the last
    std::uint64_t total = 0;           // bytes of all
    std::uint64_t begin = 0;           // of the first block, in the file
  };

  // `count` tuples of an array from `from` on, and where they go.
  struct Run
  {
    std::uint64_t from, count, to;
  };
  using Runs = std::vector<Run>;  // in the order of the array

  static Runs Whole(std::int64_t tuples) { return {{0, static_cast<std::uint64_t>(tuples), 0}}; }

  static std::size_t Count(const Runs& runs)
  {
    return std::accumulate(runs.begin(), runs.end(), std::size_t(0),
                           [](std::size_t sum, const Run& run) { return sum + run.count; });
  }

  void Choose(FieldChunks* chunks)
  {
    wanted_ = Whole(points_);
    if (!chunks)
    {
      return;
    }
    wanted_.clear();
    const auto points = static_cast<std::uint64_t>(points_);
    CountChunks(points, *chunks);
    std::vector<std::uint64_t> to(chunks->sizes.size(), 0);
    std::partial_sum(chunks->sizes.begin(), chunks->sizes.end() - (chunks->sizes.empty() ? 0 : 1),
                     to.begin() + (to.empty() ? 0 : 1));
    const std::uint64_t round = kChunkBlock * static_cast<std::uint64_t>(chunks->total);
    for (std::uint64_t first = kChunkBlock * static_cast<std::uint64_t>(chunks->first); first < points; first += round)
    {
      for (std::size_t k = 0; k < to.size() && first + k * kChunkBlock < points; ++k)
      {
        const std::uint64_t from = first + k * kChunkBlock, count = std::min<std::uint64_t>(kChunkBlock, points - from);
        wanted_.push_back({from, count, to[k]});
        to[k] += count;
      }
    }
  }

  // At most `count` bytes, fewer at the end of the file.
  std::string BytesAt(std::uint64_t position, std::uint64_t count)
  {
    std::string bytes(static_cast<std::size_t>(std::min(count, file_.Size() - std::min(position, file_.Size()))), '\0');
    file_.Seek(position);
    bytes.resize(file_.Read(bytes.data(), bytes.size()));
    return bytes;
  }

  // An array whose blocks hold as many bytes as its shape needs.
  struct FoundArray
  {
    const char* name;
    std::int64_t tuples;
    std::int64_t components;
    bool isSingle;  // Float32
    Blocks blocks;
  };

  FileError Damaged(const std::string& what) const
  {
    return FormatError(name_ + ": " + what + " is damaged, truncated or of another size than stated");
  }

  void RequireSound(bool isSound, const std::string& what) const
  {
    if (!isSound)
    {
      throw Damaged(what);
    }
  }

  FileError TooMuchText(const std::string& what) const
  {
    return FormatError(name_ + ": " + what + " has more than " + std::to_string(mostTextBytes) + " bytes or " +
                       std::to_string(mostStrings) + " lines; shorten or remove it");
  }

  pugi::xml_node PointsNode() const { return piece_.child("Points").child("DataArray"); }

  pugi::xml_node Node(const ArrayName& wanted) const
  {
    const bool isOfPoints = std::strcmp(wanted.parent, "PointData") == 0;
    const pugi::xml_node parent = isOfPoints ? piece_.child("PointData") : polyData_.child("FieldData");
    const char* kind = std::strcmp(wanted.ownType, "String") == 0 ? "Array" : "DataArray";
    return parent.find_child_by_attribute(kind, "Name", wanted.name);
  }

  // One of kArrays by its name.
  pugi::xml_node Node(const char* name) const
  {
    return Node(*std::find_if(std::begin(kArrays), std::end(kArrays),
                              [name](const ArrayName& array) { return std::strcmp(array.name, name) == 0; }));
  }

  // Refuses what is no encoding of VTK's, because that is damage, and tells ours from the others.
  void FindEncoding(bool raw)
  {
    for (const pugi::xml_attribute& attribute : root_.attributes())
    {
      if (!IsOneOf(attribute.name(), {"type", "version", "byte_order", "header_type", "compressor"}))
      {
        throw FormatError(name_ + ": VTKFile has the attribute " + Quoted(attribute.name()) + ", which is not known");
      }
    }
    const std::string order = root_.attribute("byte_order").value();
    const std::string header = root_.attribute("header_type").value();
    const std::string compressor = root_.attribute("compressor").value();
    if (!IsOneOf(order, {"LittleEndian", "BigEndian"}) || !IsOneOf(header, {"", "UInt32", "UInt64"}) ||
        !IsOneOf(compressor, {"", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor"}))
    {
      throw FormatError(name_ + ": byte_order " + Quoted(order) + ", header_type " + Quoted(header) +
                        " and compressor " + Quoted(compressor) + " are no encoding of VTK's");
    }
    ours_ = raw && header == "UInt64" && compressor == "vtkZLibDataCompressor" &&
            order == (kThisMachineIsBigEndian ? "BigEndian" : "LittleEndian");
    const auto look = [this](const pugi::xml_node& node, const char* name, const std::string& ownType)
    {
      const std::string type = node.attribute("type").value();
      const std::string format = node.attribute("format").value();
      if (!IsOneOf(type, {"Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Float32",
                          "Float64", "String"}) ||
          !IsOneOf(format, {"ascii", "binary", "appended"}))
      {
        throw FormatError(name_ + ": " + name + " has the type " + Quoted(type) + " and the format " + Quoted(format) +
                          "; numbers of 8 to 64 bits in ascii, binary or appended are read");
      }
      std::int64_t strings = 0;
      if (type == "String" && ParseNumber(node.attribute("NumberOfTuples").value(), strings) && strings > mostStrings)
      {
        throw TooMuchText(name);
      }
      ours_ = ours_ && (type == ownType || (type == "Float32" && ownType == "Float64")) && format == "appended";
    };
    if (points_ > 0)
    {
      RequireFormat(PointsNode(), name_, ": the array Points is missing");
      look(PointsNode(), "Points", "Float64");
    }
    for (const ArrayName& wanted : kArrays)
    {
      if (const pugi::xml_node node = Node(wanted))
      {
        look(node, wanted.name, wanted.ownType);
      }
    }
  }

  // What VTK's reader sizes its arrays by, in all elements, before it sees the file: whole numbers, and no more than the
  // file can hold. An array of no components stands for one.
  void RequireSizes(const pugi::xml_node& node) const
  {
    const auto most = static_cast<std::int64_t>(
        std::min<std::uint64_t>(file_.Size() * deflateLimit, static_cast<std::uint64_t>(mostPoints)));
    const auto require = [&](const char* attribute, std::int64_t least, std::int64_t largest)
    {
      const std::string text = node.attribute(attribute).value();
      std::int64_t number = 0;
      if (!text.empty() && (!ParseNumber(text, number) || number < least || number > largest))
      {
        throw FormatError(name_ + ": " + node.name() + " " + Quoted(node.attribute("Name").value()) + ": " + attribute +
                          " is " + Quoted(text) + "; " + std::to_string(least) + " to " + std::to_string(largest) +
                          " are read");
      }
    };
    for (const char* count :
         {"NumberOfPoints", "NumberOfVerts", "NumberOfLines", "NumberOfStrips", "NumberOfPolys", "NumberOfTuples"})
    {
      require(count, 0, most);
    }
    require("NumberOfComponents", 1, mostComponents);
    require("offset", 0, static_cast<std::int64_t>(file_.Size()));
    for (const pugi::xml_node& child : node.children())
    {
      RequireSizes(child);
    }
  }

  // `tuples` is what an array of the piece has; the array's own word goes before it.
  FoundArray Find(const pugi::xml_node& node, const char* name, std::int64_t tuples)
  {
    std::int64_t components = 1;
    const pugi::xml_attribute statedTuples = node.attribute("NumberOfTuples");
    const pugi::xml_attribute statedComponents = node.attribute("NumberOfComponents");
    if ((statedTuples && (!ParseNumber(statedTuples.value(), tuples) || tuples < 0 || tuples > mostPoints)) ||
        (statedComponents &&
         (!ParseNumber(statedComponents.value(), components) || components < 1 || components > mostComponents)))
    {
      throw FormatError(name_ + ": " + name + " claims " + Quoted(node.attribute("NumberOfTuples").value()) +
                        " tuples of " + Quoted(node.attribute("NumberOfComponents").value()) + " components");
    }
    const std::string_view type = node.attribute("type").value();
    const bool isDouble = type == "Float64";
    FoundArray found = {name, tuples, components, type == "Float32", FindBlocks(node, name)};
    const std::uint64_t bytes = isDouble ? sizeof(double) : sizeof(float);  // Int32 is as large as Float32
    RequireSound(found.blocks.total == static_cast<std::uint64_t>(tuples * components) * bytes, name);
    return found;
  }

  FoundArray FindOfPoints(const char* name, int components)
  {
    const pugi::xml_node node = Node(name);
    if (!node)
    {
      throw MissingArray(kOwner, name, components, points_);
    }
    return Find(node, name, points_);
  }

  std::int32_t ReadVersion(const char* name)
  {
    const FoundArray version = FindRequired(name, 1);
    RequireArrayShape(kOwner, version.name, version.components, version.tuples, 1, 1);
    std::int32_t number = 0;
    Inflate(version, Whole(1), sizeof(number), &number);
    return number;
  }

  // An array of field data that must be there.
  FoundArray FindRequired(const char* name, int components)
  {
    const pugi::xml_node node = Node(name);
    if (!node)
    {
      throw MissingArray(kOwner, name, components, 1);
    }
    return Find(node, name, 1);
  }

  // As FindRequired, of so many tuples; negative: of any number.
  std::vector<double> ReadNumbers(const char* name, int components, std::int64_t tuples)
  {
    const FoundArray found = FindRequired(name, components);
    RequireArrayShape(kOwner, name, found.components, found.tuples, components, tuples < 0 ? found.tuples : tuples);
    std::vector<double> numbers(static_cast<std::size_t>(found.tuples) * components);
    ReadDoubles(found, Whole(found.tuples), numbers.data());
    return numbers;
  }

  ViewDependence ReadView()
  {
    RequireViewVersion(kOwner, ReadVersion("ViewVersion"));
    ViewDependence view;
    ReadVectors(FindOfPoints("ViewTerm", 3), wanted_, view.terms);
    const std::vector<double> mean = ReadNumbers("ViewMean", 9, 1), steps = ReadNumbers("ViewSteps", 3, 1);
    view.views.mean = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mean.data());
    view.views.unit = steps[0];
    view.views.angleStep = steps[1];
    view.views.elevationStep = steps[2];
    const std::vector<double> poses = ReadNumbers("ViewPoses", 16, -1);
    for (std::size_t k = 0; k < poses.size(); k += 16)
    {
      view.views.poses.emplace_back(Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(&poses[k]));
    }
    return view;
  }

  FieldLabels ReadLabels()
  {
    const FoundArray values = FindRequired("LabelValues", 1);
    const std::vector<double> colors = ReadNumbers("LabelColors", 3, values.tuples);
    std::vector<std::int32_t> numbers(static_cast<std::size_t>(values.tuples));
    Inflate(values, Whole(values.tuples), sizeof(std::int32_t), numbers.data());
    std::vector<std::string> names;
    if (const pugi::xml_node node = Node("LabelNames"))
    {
      ReadStrings(node, "LabelNames", names);
    }
    names.resize(numbers.size());
    FieldLabels labels;
    for (std::size_t k = 0; k < numbers.size(); ++k)
    {
      labels.labels.push_back({numbers[k], names[k], {colors[3 * k], colors[3 * k + 1], colors[3 * k + 2]}});
    }
    AddWeights(FindOfPoints("LabelWeight", static_cast<int>(numbers.size())), points_, wanted_, labels);
    if (Node("LabelPoints"))
    {
      const FoundArray points = FindRequired("LabelPoints", 4);
      ReadVectors(points, Whole(points.tuples), labels.points);
      AddWeights(FindRequired("LabelPointWeight", static_cast<int>(numbers.size())), points.tuples,
                 Whole(points.tuples), labels);
    }
    return labels;
  }

  // Those of the runs go behind those that there are.
  void AddWeights(const FoundArray& found, std::int64_t tuples, const Runs& runs, FieldLabels& labels)
  {
    const std::size_t count = labels.labels.size(), before = labels.weights.size();
    RequireArrayShape(kOwner, found.name, found.components, found.tuples, static_cast<int>(count), tuples);
    labels.weights.resize(before + Count(runs) * count);
    Inflate(found, runs, count * sizeof(float), labels.weights.data() + before);
  }

  void ReadScalar(const char* name, bool required, double& value)
  {
    const pugi::xml_node node = Node(name);
    if (!node && required)
    {
      throw MissingArray(kOwner, name, 1, 1);
    }
    if (node)
    {
      const FoundArray found = Find(node, name, 1);
      RequireArrayShape(kOwner, name, found.components, found.tuples, 1, 1);
      ReadDoubles(found, Whole(1), &value);
    }
  }

  template <int Rows>
  void ReadVectors(const FoundArray& found, const Runs& runs, std::vector<Eigen::Matrix<double, Rows, 1>>& vectors)
  {
    RequireArrayShape(kOwner, found.name, found.components, found.tuples, Rows, found.tuples);
    vectors.resize(Count(runs));
    static_assert(sizeof(vectors[0]) == Rows * sizeof(double), "they lie one after another, as in the file");
    ReadDoubles(found, runs, reinterpret_cast<double*>(vectors.data()));
  }

  // `values` has room for all of the runs.
  void ReadDoubles(const FoundArray& found, const Runs& runs, double* values)
  {
    const auto components = static_cast<std::size_t>(found.components);
    if (!found.isSingle)
    {
      Inflate(found, runs, components * sizeof(double), values);
      return;
    }
    std::vector<float> singles(Count(runs) * components);
    Inflate(found, runs, components * sizeof(float), singles.data());
    std::copy(singles.begin(), singles.end(), values);
  }

  // Strings are stored one after the other, each with a zero at its end.
  void ReadStrings(const pugi::xml_node& node, const char* name, std::vector<std::string>& strings)
  {
    const FoundArray found = {name, 0, 1, false, FindBlocks(node, name)};
    if (found.blocks.total > mostTextBytes)
    {
      throw TooMuchText(name);
    }
    std::string bytes(found.blocks.total, '\0');
    Inflate(found, Whole(static_cast<std::int64_t>(bytes.size())), 1, bytes.data());
    if (std::count(bytes.begin(), bytes.end(), '\0') > mostStrings)
    {
      throw TooMuchText(name);
    }
    for (std::size_t begin = 0; begin < bytes.size();)
    {
      const std::size_t end = std::min(bytes.find('\0', begin), bytes.size());
      strings.push_back(bytes.substr(begin, end - begin));
      begin = end + 1;
    }
  }

  // Number of blocks, size of a block, size of the last one where it is smaller (else 0), compressed size of each; then
  // the blocks. All numbers agree with each other and with the bytes there are when this returns.
  Blocks FindBlocks(const pugi::xml_node& node, const std::string& what)
  {
    constexpr std::uint64_t number = sizeof(std::uint64_t);
    std::int64_t offset = -1;
    RequireSound(ParseNumber(node.attribute("offset").value(), offset) && offset >= 0 &&
                     static_cast<std::uint64_t>(offset) <= appendedSize_,
                 what);
    std::uint64_t at = appendedBegin_ + static_cast<std::uint64_t>(offset);
    const std::uint64_t end = appendedBegin_ + appendedSize_;
    const auto take = [&](std::uint64_t* numbers, std::uint64_t count)
    {
      file_.Seek(at);
      RequireSound(count <= (end - at) / number && file_.Read(numbers, count * number) == count * number, what);
      at += count * number;
    };
    Blocks blocks;
    std::uint64_t count = 0;
    take(&count, 1);
    if (count == 0)
    {
      return blocks;
    }
    std::uint64_t stated[2];  // size of a block, and of the last
    take(stated, 2);
    blocks.blockSize = stated[0];
    const std::uint64_t lastSize = stated[1];
    if (count > (end - at) / number || blocks.blockSize > largestVtp || lastSize > blocks.blockSize ||
        (blocks.blockSize > 0 && count > std::numeric_limits<std::uint64_t>::max() / blocks.blockSize))
    {
      throw Damaged(what);
    }
    blocks.total = (count - (lastSize ? 1 : 0)) * blocks.blockSize + lastSize;
    RequireSound(blocks.total / deflateLimit <= end - at, what);
    blocks.sizes.resize(static_cast<std::size_t>(count));
    take(blocks.sizes.data(), count);
    blocks.begin = at;
    for (const std::uint64_t size : blocks.sizes)
    {
      RequireSound(size <= end - at, what);
      at += size;
    }
    return blocks;
  }

  // The tuples of the runs, of so many bytes each; `out` has room for them. Blocks without any are not looked at.
  void Inflate(const FoundArray& found, const Runs& runs, std::size_t tupleBytes, void* out)
  {
    const Blocks& blocks = found.blocks;
    std::string packed, unpacked;
    std::uint64_t at = blocks.begin, done = 0;  // in the file, and bytes of the array before this block
    auto run = runs.begin();
    for (const std::uint64_t size : blocks.sizes)
    {
      const std::uint64_t bytes = std::min(blocks.blockSize, blocks.total - done);
      while (run != runs.end() && (run->from + run->count) * tupleBytes <= done)
      {
        ++run;
      }
      if (run != runs.end() && run->from * tupleBytes < done + bytes)
      {
        packed = BytesAt(at, size);
        unpacked.resize(static_cast<std::size_t>(bytes));
        auto room = static_cast<uLongf>(bytes);
        if (packed.size() != size ||
            uncompress(reinterpret_cast<Bytef*>(unpacked.data()), &room, reinterpret_cast<const Bytef*>(packed.data()),
                       static_cast<uLong>(size)) != Z_OK ||
            room != bytes)
        {
          throw Damaged(found.name);
        }
        for (auto part = run; part != runs.end() && part->from * tupleBytes < done + bytes; ++part)
        {
          const std::uint64_t begin = std::max(part->from * tupleBytes, done);
          const std::uint64_t end = std::min((part->from + part->count) * tupleBytes, done + bytes);
          std::memcpy(static_cast<char*>(out) + part->to * tupleBytes + (begin - part->from * tupleBytes),
                      unpacked.data() + (begin - done), static_cast<std::size_t>(end - begin));
        }
      }
      at += size;
      done += bytes;
    }
  }

  std::string name_;
  InputFile file_;
  pugi::xml_document document_;
  pugi::xml_node root_, polyData_, piece_;
  std::uint64_t appendedBegin_ = 0, appendedSize_ = 0;  // bytes of the file
  std::int64_t points_ = 0;
  Runs wanted_;  // of the points
  bool ours_ = false;
};

// The size of a block before it is compressed, and zlib's level: those of VTK's own writer.
constexpr std::size_t kBlockBytes = 32768;
constexpr int kLevel = 5;

/// The compressed arrays of a file, one after the other.
class AppendedArrays
{
public:
  /// Compresses an array, and returns the attributes of its element that say where it is.
  std::string Add(const void* bytes, std::size_t count)
  {
    const std::size_t offset = data_.size();
    const std::size_t blocks = (count + kBlockBytes - 1) / kBlockBytes;
    Put(blocks);
    if (blocks > 0)
    {
      Put(kBlockBytes);
      Put(count % kBlockBytes);  // of the last block; 0: it is as large as the others
      std::size_t sizesAt = data_.size();
      data_.resize(sizesAt + blocks * sizeof(std::uint64_t));
      for (std::size_t done = 0; done < count; done += kBlockBytes)
      {
        const std::size_t part = std::min(kBlockBytes, count - done);
        auto size = static_cast<uLongf>(buffer_.size());
        if (compress2(buffer_.data(), &size, static_cast<const Bytef*>(bytes) + done, static_cast<uLong>(part),
                      kLevel) != Z_OK)
        {
          throw FileError(FileFault::Unknown, "zlib cannot compress");
        }
        const std::uint64_t stated = size;
        std::memcpy(&data_[sizesAt], &stated, sizeof(stated));
        sizesAt += sizeof(stated);
        data_.append(reinterpret_cast<const char*>(buffer_.data()), size);
      }
    }
    return " format=\"appended\" offset=\"" + std::to_string(offset) + "\"/>\n";
  }

  const std::string& Data() const { return data_; }

private:
  void Put(std::uint64_t number) { data_.append(reinterpret_cast<const char*>(&number), sizeof(number)); }

  std::string data_;
  std::vector<Bytef> buffer_ = std::vector<Bytef>(compressBound(kBlockBytes));
};

/// The XML of a file, written while its arrays are compressed.
class VtpText
{
public:
  void Line(const std::string& line) { text_ += line + "\n"; }

  /// Of the points, in 32 bits or in 64.
  void AddDoubles(const char* name, int components, const double* values, std::size_t count, bool isSingle)
  {
    if (isSingle)
    {
      const std::vector<float> singles(values, values + count);
      AddArray("Float32", name, components, singles.data(), singles.size(), -1);
    }
    else
    {
      AddArray("Float64", name, components, values, count, -1);
    }
  }

  /// A number of the whole field, in 64 bits.
  void AddScalar(const char* name, double value) { AddArray("Float64", name, 1, &value, 1, 1); }

  template <class Number>
  void AddArray(const std::string& type, const char* name, int components, const Number* values, std::size_t count,
                std::int64_t tuples)
  {
    text_ += "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" +
             std::to_string(components) + "\"" +
             (tuples >= 0 ? " NumberOfTuples=\"" + std::to_string(tuples) + "\"" : "") +
             arrays_.Add(values, count * sizeof(Number));
  }

  void AddStrings(const char* name, const std::vector<std::string>& strings)
  {
    std::string bytes;
    for (const std::string& line : strings)
    {
      bytes += line.substr(0, line.find('\0')) + '\0';
    }
    text_ += std::string("<Array type=\"String\" Name=\"") + name + "\" NumberOfTuples=\"" +
             std::to_string(strings.size()) + "\"" + arrays_.Add(bytes.data(), bytes.size());
  }

  void Write(AtomicFile& file) const
  {
    file.Write(text_);
    file.Write("<AppendedData encoding=\"raw\">\n_");
    file.Write(arrays_.Data());
    file.Write("\n</AppendedData>\n</VTKFile>\n");
  }

private:
  std::string text_;
  AppendedArrays arrays_;
};

/// Whether there are values and floats hold all of them.
bool FitFloats(const double* values, std::size_t count)
{
  // What lies beyond the range of a float must not be converted to one.
  const auto fits = [](double value)
  {
    return std::abs(value) <= std::numeric_limits<float>::max() &&
           static_cast<double>(static_cast<float>(value)) == value;
  };
  return count > 0 && std::all_of(values, values + count, fits);
}

template <int Rows>
const double* NumbersOf(const std::vector<Eigen::Matrix<double, Rows, 1>>& vectors)
{
  static_assert(sizeof(vectors[0]) == Rows * sizeof(double), "they lie one after another");
  return reinterpret_cast<const double*>(vectors.data());
}

void AddViews(const RecordedViews& views, VtpText& text)
{
  const std::int32_t version = kViewVersion;
  text.AddArray("Int32", "ViewVersion", 1, &version, 1, 1);
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> mean = views.mean;
  text.AddArray("Float64", "ViewMean", 9, mean.data(), 9, 1);
  const double steps[3] = {views.unit, views.angleStep, views.elevationStep};
  text.AddArray("Float64", "ViewSteps", 3, steps, 3, 1);
  const std::vector<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> poses(views.poses.begin(), views.poses.end());
  text.AddArray("Float64", "ViewPoses", 16, poses.empty() ? nullptr : poses[0].data(), 16 * poses.size(),
                static_cast<std::int64_t>(poses.size()));
}

void AddLabels(const FieldLabels& all, std::size_t gaussians, VtpText& text)
{
  std::vector<std::string> names;
  std::vector<std::int32_t> values;
  std::vector<double> colors;
  for (const Label& label : all.labels)
  {
    names.push_back(label.name);
    values.push_back(label.value);
    colors.insert(colors.end(), label.color.begin(), label.color.end());
  }
  const auto count = static_cast<std::int64_t>(values.size()), m = static_cast<std::int64_t>(all.points.size());
  text.AddStrings("LabelNames", names);
  text.AddArray("Int32", "LabelValues", 1, values.data(), values.size(), count);
  text.AddArray("Float64", "LabelColors", 3, colors.data(), colors.size(), count);
  text.AddArray("Float64", "LabelPoints", 4, NumbersOf(all.points), 4 * all.points.size(), m);
  text.AddArray("Float32", "LabelPointWeight", static_cast<int>(count), all.weights.data() + gaussians * values.size(),
                all.points.size() * values.size(), m);
}

}  // namespace

std::optional<StoredField> ReadVtp(const std::string& fileName, FieldChunks* chunks)
{
  VtpFile file(fileName);
  return file.IsOurs() ? std::optional<StoredField>(file.Field(chunks)) : std::nullopt;
}

VtpSingles SinglesOf(const StoredField& stored)
{
  const GaussianField& field = stored.field;
  const std::size_t n = field.Size();
  return {FitFloats(NumbersOf(field.means), 3 * n), FitFloats(NumbersOf(field.scales), 3 * n),
          FitFloats(NumbersOf(field.rotations), 4 * n), FitFloats(field.reflectivities.data(), n),
          stored.view && FitFloats(NumbersOf(stored.view->terms), 3 * n)};
}

void WriteVtp(const StoredField& stored, AtomicFile& file, const VtpSingles& singles)
{
  const GaussianField& field = stored.field;
  const std::size_t n = field.Size();
  const std::string points = std::to_string(n);
  VtpText text;
  text.Line("<?xml version=\"1.0\"?>");
  text.Line(std::string("<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"") +
            (kThisMachineIsBigEndian ? "BigEndian" : "LittleEndian") +
            "\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">");
  text.Line("<PolyData>");
  text.Line("<FieldData>");
  text.AddScalar("Gamma", field.transfer.gamma);
  text.AddScalar("ElevationSigma", field.beam.elevationSigma);
  if (field.beam.probeElevationSigma > 0)
  {
    text.AddScalar("ProbeElevationSigma", field.beam.probeElevationSigma);
  }
  if (const auto& normals = field.beam.trainedNormals; !normals.empty())
  {
    text.AddArray("Float64", "TrainedNormals", 3, NumbersOf(normals), 3 * normals.size(),
                  static_cast<std::int64_t>(normals.size()));
  }
  const std::int32_t version = kFieldFormatVersion;
  text.AddArray("Int32", "FormatVersion", 1, &version, 1, 1);
  if (stored.view)
  {
    AddViews(stored.view->views, text);
  }
  if (stored.labels)
  {
    AddLabels(*stored.labels, n, text);
  }
  if (!stored.provenance.empty())
  {
    text.AddStrings("Provenance", stored.provenance);
  }
  if (!stored.standardError.empty())
  {
    text.AddArray("UInt8", "StandardError", 1, stored.standardError.data(), stored.standardError.size(),
                  static_cast<std::int64_t>(stored.standardError.size()));
  }
  text.Line("</FieldData>");
  text.Line("<Piece NumberOfPoints=\"" + points + "\" NumberOfVerts=\"" + points +
            "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">");
  text.Line("<PointData Scalars=\"Reflectivity\">");
  text.AddDoubles("Scale", 3, NumbersOf(field.scales), 3 * n, singles.scales);
  text.AddDoubles("Rotation", 4, NumbersOf(field.rotations), 4 * n, singles.rotations);
  text.AddDoubles("Reflectivity", 1, field.reflectivities.data(), n, singles.reflectivities);
  if (stored.view)
  {
    text.AddDoubles("ViewTerm", 3, NumbersOf(stored.view->terms), 3 * n, singles.viewTerms);
  }
  if (stored.labels)
  {
    text.AddArray("Float32", "LabelWeight", static_cast<int>(stored.labels->labels.size()),
                  stored.labels->weights.data(), n * stored.labels->labels.size(), -1);
  }
  text.Line("</PointData>");
  text.Line("<CellData/>");
  text.Line("<Points>");
  text.AddDoubles("Points", 3, NumbersOf(field.means), 3 * n, singles.means);
  text.Line("</Points>");
  // One vertex a point, so that viewers show them.
  text.Line("<Verts>");
  std::vector<std::int32_t> numbers(n);
  std::iota(numbers.begin(), numbers.end(), 0);
  text.AddArray("Int32", "connectivity", 1, numbers.data(), n, -1);
  std::iota(numbers.begin(), numbers.end(), 1);
  text.AddArray("Int32", "offsets", 1, numbers.data(), n, -1);
  text.Line("</Verts>");
  text.Line("</Piece>");
  text.Line("</PolyData>");
  text.Write(file);
}

}  // namespace bigus
