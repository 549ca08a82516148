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

constexpr std::uint64_t largestFile = std::uint64_t(4) << 30;
constexpr std::int64_t mostPoints = 1000000000;
constexpr std::int64_t mostComponents = 16;
// Of the provenance. Every string costs 32 bytes in memory, however short it is, so their number needs a bound of its own.
constexpr std::uint64_t mostTextBytes = 1u << 20;
constexpr std::int64_t mostStrings = 10000;

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
constexpr ArrayName kArrays[] = {{"PointData", "Scale", "Float64"},
                                 {"PointData", "Rotation", "Float64"},
                                 {"PointData", "Reflectivity", "Float64"},
                                 {"FieldData", "Gamma", "Float64"},
                                 {"FieldData", "ElevationSigma", "Float64"},
                                 {"FieldData", "FormatVersion", "Int32"},
                                 {"FieldData", "ProbeElevationSigma", "Float64"},
                                 {"FieldData", "TrainedNormals", "Float64"},
                                 {"FieldData", "Provenance", "String"}};

bool IsOneOf(const std::string& text, std::initializer_list<const char*> known)
{
  return std::find(known.begin(), known.end(), text) != known.end();
}

class VtpFile
{
public:
  explicit VtpFile(const std::string& fileName) : name_(fileName), text_(ReadTextFile(fileName, largestFile))
  {
    if (text_.find("</VTKFile>", text_.size() - std::min<std::size_t>(text_.size(), 64)) == std::string::npos)
    {
      throw TruncationError(name_ + ": does not end with </VTKFile>; the file is truncated");
    }
    // What follows <AppendedData ...> _ is not XML.
    const std::size_t appended = text_.find("<AppendedData");
    std::string beforeAppended;
    bool raw = false;
    if (appended != std::string::npos)
    {
      const std::size_t begin = text_.find('_', appended);
      const std::size_t end = text_.rfind("</AppendedData>");
      if (begin == std::string::npos || end == std::string::npos || end < begin)
      {
        throw Damaged("the appended data");
      }
      const std::string tag = text_.substr(appended, begin - appended);
      raw = tag.find("encoding=\"raw\"") != std::string::npos;
      if (!raw && tag.find("encoding=\"base64\"") == std::string::npos)
      {
        throw Damaged("the encoding of the appended data");
      }
      appended_ = std::string_view(text_).substr(begin + 1, end - begin - 1);
      beforeAppended = text_.substr(0, appended) + "</VTKFile>";
    }
    const std::string& xml = appended != std::string::npos ? beforeAppended : text_;
    root_ = ParseXml(xml, name_ + ": not valid XML");
    if (root_.name != "VTKFile" || root_.Value("type") != "PolyData")
    {
      throw FormatError(name_ + ": not a VTK XML PolyData file");
    }
    polyData_ = root_.Child("PolyData");
    const auto isPiece = [](const XmlElement& child) { return child.name == "Piece"; };
    if (!polyData_ || std::count_if(polyData_->children.begin(), polyData_->children.end(), isPiece) != 1)
    {
      throw FormatError(name_ + ": must have one Piece");
    }
    piece_ = polyData_->Child("Piece");
    const std::string points = piece_->Value("NumberOfPoints");
    if (!ParseNumber(points, points_) || points_ < 0 || points_ > mostPoints ||
        static_cast<std::uint64_t>(points_) > text_.size() * deflateLimit)
    {
      throw FormatError(name_ + ": NumberOfPoints is " + Quoted(points) + "; 0 to " + std::to_string(mostPoints) +
                        " are read, and no more than the file can hold");
    }
    FindEncoding(raw);
  }

  /// Whether the file is encoded as we write it, so that Field can read it.
  bool IsOurs() const { return ours_; }

  StoredField Field()
  {
    StoredField stored;
    GaussianField& field = stored.field;
    const bool required = points_ > 0;
    if (const XmlElement* node = Node("FormatVersion"))
    {
      const FoundArray version = Find(*node, "FormatVersion", 1);
      RequireArrayShape(kOwner, version.name, version.components, version.tuples, 1, 1);
      std::int32_t number = 0;
      Inflate(version, &number);
      RequireFieldFormatVersion(kOwner, number);
    }
    ReadScalar("Gamma", required, field.transfer.gamma);
    ReadScalar("ElevationSigma", required, field.beam.elevationSigma);
    ReadScalar("ProbeElevationSigma", false, field.beam.probeElevationSigma);
    if (const XmlElement* node = Node("TrainedNormals"))
    {
      const FoundArray normals = Find(*node, "TrainedNormals", 1);
      RequireFewTrainedNormals(kOwner, normals.tuples);
      ReadVectors(normals, normals.tuples, field.beam.trainedNormals);
    }
    if (required)
    {
      const FoundArray points = Find(*PointsNode(), "Points", points_);
      if (points.components != 3 || points.tuples != points_)
      {
        throw FormatError(name_ + ": Points must have 3 components and " + std::to_string(points_) + " tuples");
      }
      ReadVectors(points, points_, field.means);
      ReadVectors(FindOfPoints("Scale", 3), points_, field.scales);
      ReadVectors(FindOfPoints("Rotation", 4), points_, field.rotations);
      const FoundArray reflectivities = FindOfPoints("Reflectivity", 1);
      RequireArrayShape(kOwner, reflectivities.name, reflectivities.components, reflectivities.tuples, 1, points_);
      field.reflectivities.resize(static_cast<std::size_t>(points_));
      ReadDoubles(reflectivities, field.reflectivities.data());
    }
    if (const XmlElement* node = Node("Provenance"))
    {
      ReadStrings(*node, "Provenance", stored.provenance);
    }
    return stored;
  }

private:
  // The blocks of one compressed array.
  struct Blocks
  {
    std::vector<std::uint64_t> sizes;  // compressed bytes of each
    std::uint64_t blockSize = 0;       // bytes of each but the last
    std::uint64_t total = 0;           // bytes of all
    std::string_view data;
  };

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

  FileError TooMuchText(const std::string& what) const
  {
    return FormatError(name_ + ": " + what + " has more than " + std::to_string(mostTextBytes) + " bytes or " +
                       std::to_string(mostStrings) + " lines; shorten or remove it");
  }

  const XmlElement* PointsNode() const
  {
    const XmlElement* points = piece_->Child("Points");
    return points ? points->Child("DataArray") : nullptr;
  }

  const XmlElement* Node(const ArrayName& wanted) const
  {
    const XmlElement* parent =
        std::strcmp(wanted.parent, "PointData") == 0 ? piece_->Child("PointData") : polyData_->Child("FieldData");
    const char* kind = std::strcmp(wanted.ownType, "String") == 0 ? "Array" : "DataArray";
    for (std::size_t k = 0; parent && k < parent->children.size(); ++k)
    {
      const XmlElement& child = parent->children[k];
      if (child.name == kind && child.Value("Name") == wanted.name)
      {
        return &child;
      }
    }
    return nullptr;
  }

  // One of kArrays by its name.
  const XmlElement* Node(const char* name) const
  {
    return Node(*std::find_if(std::begin(kArrays), std::end(kArrays),
                              [name](const ArrayName& array) { return std::strcmp(array.name, name) == 0; }));
  }

  // Refuses what is no encoding of VTK's, because that is damage, and tells ours from the others.
  void FindEncoding(bool raw)
  {
    for (const auto& attribute : root_.attributes)
    {
      if (!IsOneOf(attribute.first, {"type", "version", "byte_order", "header_type", "compressor"}))
      {
        throw FormatError(name_ + ": VTKFile has the attribute " + Quoted(attribute.first) + ", which is not known");
      }
    }
    const std::string order = root_.Value("byte_order");
    const std::string header = root_.Value("header_type");
    const std::string compressor = root_.Value("compressor");
    if (!IsOneOf(order, {"LittleEndian", "BigEndian"}) || !IsOneOf(header, {"", "UInt32", "UInt64"}) ||
        !IsOneOf(compressor, {"", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor"}))
    {
      throw FormatError(name_ + ": byte_order " + Quoted(order) + ", header_type " + Quoted(header) +
                        " and compressor " + Quoted(compressor) + " are no encoding of VTK's");
    }
    ours_ = raw && header == "UInt64" && compressor == "vtkZLibDataCompressor" &&
            order == (kThisMachineIsBigEndian ? "BigEndian" : "LittleEndian");
    const auto look = [this](const XmlElement& node, const char* name, const std::string& ownType)
    {
      const std::string type = node.Value("type");
      const std::string format = node.Value("format");
      if (!IsOneOf(type, {"Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Float32",
                          "Float64", "String"}) ||
          !IsOneOf(format, {"ascii", "binary", "appended"}))
      {
        throw FormatError(name_ + ": " + name + " has the type " + Quoted(type) + " and the format " + Quoted(format) +
                          "; numbers of 8 to 64 bits in ascii, binary or appended are read");
      }
      std::int64_t strings = 0;
      if (type == "String" && ParseNumber(node.Value("NumberOfTuples"), strings) && strings > mostStrings)
      {
        throw TooMuchText(name);
      }
      ours_ = ours_ && (type == ownType || (type == "Float32" && ownType == "Float64")) && format == "appended";
    };
    if (points_ > 0)
    {
      if (!PointsNode())
      {
        throw FormatError(name_ + ": the array Points is missing");
      }
      look(*PointsNode(), "Points", "Float64");
    }
    for (const ArrayName& wanted : kArrays)
    {
      if (const XmlElement* node = Node(wanted))
      {
        look(*node, wanted.name, wanted.ownType);
      }
    }
  }

  // `tuples` is what an array of the piece has; the array's own word goes before it.
  FoundArray Find(const XmlElement& node, const char* name, std::int64_t tuples) const
  {
    std::int64_t components = 1;
    const std::string* statedTuples = node.Attribute("NumberOfTuples");
    const std::string* statedComponents = node.Attribute("NumberOfComponents");
    if ((statedTuples && (!ParseNumber(*statedTuples, tuples) || tuples < 0 || tuples > mostPoints)) ||
        (statedComponents &&
         (!ParseNumber(*statedComponents, components) || components < 1 || components > mostComponents)))
    {
      throw FormatError(name_ + ": " + name + " claims " + Quoted(node.Value("NumberOfTuples")) + " tuples of " +
                        Quoted(node.Value("NumberOfComponents")) + " components");
    }
    const bool isDouble = node.Value("type") == "Float64";
    FoundArray found = {name, tuples, components, node.Value("type") == "Float32", FindBlocks(node, name)};
    const std::uint64_t bytes = isDouble ? sizeof(double) : sizeof(float);  // Int32 is as large as Float32
    if (found.blocks.total != static_cast<std::uint64_t>(tuples * components) * bytes)
    {
      throw Damaged(name);
    }
    return found;
  }

  FoundArray FindOfPoints(const char* name, int components) const
  {
    const XmlElement* node = Node(name);
    if (!node)
    {
      throw MissingArray(kOwner, name, components, points_);
    }
    return Find(*node, name, points_);
  }

  void ReadScalar(const char* name, bool required, double& value) const
  {
    const XmlElement* node = Node(name);
    if (!node && required)
    {
      throw MissingArray(kOwner, name, 1, 1);
    }
    if (node)
    {
      const FoundArray found = Find(*node, name, 1);
      RequireArrayShape(kOwner, name, found.components, found.tuples, 1, 1);
      ReadDoubles(found, &value);
    }
  }

  template <int Rows>
  void ReadVectors(const FoundArray& found, std::int64_t tuples,
                   std::vector<Eigen::Matrix<double, Rows, 1>>& vectors) const
  {
    RequireArrayShape(kOwner, found.name, found.components, found.tuples, Rows, tuples);
    vectors.resize(static_cast<std::size_t>(tuples));
    static_assert(sizeof(vectors[0]) == Rows * sizeof(double), "they lie one after another, as in the file");
    ReadDoubles(found, reinterpret_cast<double*>(vectors.data()));
  }

  // `values` has room for all of them.
  void ReadDoubles(const FoundArray& found, double* values) const
  {
    if (!found.isSingle)
    {
      Inflate(found, values);
      return;
    }
    std::vector<float> singles(static_cast<std::size_t>(found.tuples * found.components));
    Inflate(found, singles.data());
    std::copy(singles.begin(), singles.end(), values);
  }

  // Strings are stored one after the other, each with a zero at its end.
  void ReadStrings(const XmlElement& node, const char* name, std::vector<std::string>& strings) const
  {
    const FoundArray found = {name, 0, 1, false, FindBlocks(node, name)};
    if (found.blocks.total > mostTextBytes)
    {
      throw TooMuchText(name);
    }
    std::string bytes(found.blocks.total, '\0');
    Inflate(found, bytes.data());
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

  std::uint64_t TakeNumber(std::string_view& stored, const std::string& what) const
  {
    std::uint64_t number = 0;
    if (stored.size() < sizeof(number))
    {
      throw Damaged(what);
    }
    std::memcpy(&number, stored.data(), sizeof(number));
    stored.remove_prefix(sizeof(number));
    return number;
  }

  // Number of blocks, size of a block, size of the last one where it is smaller (else 0), compressed size of each; then
  // the blocks. All numbers agree with each other and with the bytes there are when this returns.
  Blocks FindBlocks(const XmlElement& node, const std::string& what) const
  {
    std::int64_t offset = -1;
    if (!ParseNumber(node.Value("offset"), offset) || offset < 0 ||
        static_cast<std::uint64_t>(offset) > appended_.size())
    {
      throw Damaged(what);
    }
    Blocks blocks;
    blocks.data = appended_.substr(static_cast<std::size_t>(offset));
    const std::uint64_t count = TakeNumber(blocks.data, what);
    if (count == 0)
    {
      return blocks;
    }
    blocks.blockSize = TakeNumber(blocks.data, what);
    const std::uint64_t lastSize = TakeNumber(blocks.data, what);
    if (count > blocks.data.size() / sizeof(std::uint64_t) || blocks.blockSize > largestFile ||
        lastSize > blocks.blockSize)
    {
      throw Damaged(what);
    }
    blocks.total = (count - (lastSize ? 1 : 0)) * blocks.blockSize + lastSize;
    if (blocks.total > blocks.data.size() * deflateLimit)
    {
      throw Damaged(what);
    }
    for (std::uint64_t block = 0; block < count; ++block)
    {
      blocks.sizes.push_back(TakeNumber(blocks.data, what));
    }
    return blocks;
  }

  // `out` has room for all bytes of the array.
  void Inflate(const FoundArray& found, void* out) const
  {
    Blocks blocks = found.blocks;
    std::uint64_t done = 0;
    for (const std::uint64_t size : blocks.sizes)
    {
      auto room = static_cast<uLongf>(std::min(blocks.blockSize, blocks.total - done));
      const uLongf wanted = room;
      if (size > blocks.data.size() ||
          uncompress(static_cast<Bytef*>(out) + done, &room, reinterpret_cast<const Bytef*>(blocks.data.data()),
                     static_cast<uLong>(size)) != Z_OK ||
          room != wanted)
      {
        throw Damaged(found.name);
      }
      blocks.data.remove_prefix(size);
      done += room;
    }
  }

  std::string name_;
  std::string text_;
  XmlElement root_;
  const XmlElement* polyData_ = nullptr;
  const XmlElement* piece_ = nullptr;
  std::string_view appended_;
  std::int64_t points_ = 0;
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

  /// In 32 bits where that holds every value. `tuples`: of a field array, else -1.
  void AddDoubles(const char* name, int components, const double* values, std::size_t count, std::int64_t tuples = -1)
  {
    // What lies beyond the range of a float must not be converted to one.
    const auto fits = [](double value)
    {
      return std::abs(value) <= std::numeric_limits<float>::max() &&
             static_cast<double>(static_cast<float>(value)) == value;
    };
    if (count > 0 && std::all_of(values, values + count, fits))
    {
      const std::vector<float> singles(values, values + count);
      AddArray("Float32", name, components, singles.data(), singles.size(), tuples);
    }
    else
    {
      AddArray("Float64", name, components, values, count, tuples);
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

template <int Rows>
const double* NumbersOf(const std::vector<Eigen::Matrix<double, Rows, 1>>& vectors)
{
  static_assert(sizeof(vectors[0]) == Rows * sizeof(double), "they lie one after another");
  return reinterpret_cast<const double*>(vectors.data());
}

}  // namespace

std::optional<StoredField> ReadVtp(const std::string& fileName)
{
  VtpFile file(fileName);
  return file.IsOurs() ? std::optional<StoredField>(file.Field()) : std::nullopt;
}

void WriteVtp(const StoredField& stored, AtomicFile& file)
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
  if (!stored.provenance.empty())
  {
    text.AddStrings("Provenance", stored.provenance);
  }
  text.Line("</FieldData>");
  text.Line("<Piece NumberOfPoints=\"" + points + "\" NumberOfVerts=\"" + points +
            "\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">");
  text.Line("<PointData Scalars=\"Reflectivity\">");
  text.AddDoubles("Scale", 3, NumbersOf(field.scales), 3 * n);
  text.AddDoubles("Rotation", 4, NumbersOf(field.rotations), 4 * n);
  text.AddDoubles("Reflectivity", 1, field.reflectivities.data(), n);
  text.Line("</PointData>");
  text.Line("<CellData/>");
  text.Line("<Points>");
  text.AddDoubles("Points", 3, NumbersOf(field.means), 3 * n);
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
