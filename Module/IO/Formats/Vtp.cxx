// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/Formats/Vtp.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <vector>

#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/Text.h"
#include "vtkCallbackCommand.h"
#include "vtkCellArray.h"
#include "vtkDoubleArray.h"
#include "vtkExecutive.h"
#include "vtkFieldData.h"
#include "vtkFloatArray.h"
#include "vtkIntArray.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPoints.h"
#include "vtkPolyData.h"
#include "vtkSmartPointer.h"
#include "vtkStringArray.h"
#include "vtkXMLPolyDataReader.h"
#include "vtkXMLPolyDataWriter.h"
#include "vtk_pugixml.h"
#include "vtk_zlib.h"

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
    const auto parsed = document_.load_buffer(xml.data(), xml.size());
    if (!parsed)
    {
      throw FormatError(name_ + ": not valid XML: " + parsed.description() + " at byte " +
                        std::to_string(parsed.offset));
    }
    const pugi::xml_node root = document_.document_element();
    if (std::strcmp(root.name(), "VTKFile") != 0 || std::strcmp(root.attribute("type").value(), "PolyData") != 0)
    {
      throw FormatError(name_ + ": not a VTK XML PolyData file");
    }
    polyData_ = root.child("PolyData");
    piece_ = polyData_.child("Piece");
    if (!piece_ || piece_.next_sibling("Piece"))
    {
      throw FormatError(name_ + ": must have one Piece");
    }
    const std::string points = piece_.attribute("NumberOfPoints").value();
    if (!ParseNumber(points, points_) || points_ < 0 || points_ > mostPoints ||
        static_cast<std::uint64_t>(points_) > text_.size() * deflateLimit)
    {
      throw FormatError(name_ + ": NumberOfPoints is " + Quoted(points) + "; 0 to " + std::to_string(mostPoints) +
                        " are read, and no more than the file can hold");
    }
    FindEncoding(root, raw);
  }

  /// Whether the file is encoded as we write it, so that Fill can read it.
  bool IsOurs() const { return ours_; }

  void Fill(vtkPolyData* polyData)
  {
    if (points_ > 0)
    {
      const auto coordinates = ReadFloating(PointsNode(), "Points", points_);
      if (coordinates->GetNumberOfComponents() != 3 || coordinates->GetNumberOfTuples() != points_)
      {
        throw FormatError(name_ + ": Points must have 3 components and " + std::to_string(points_) + " tuples");
      }
      vtkNew<vtkPoints> points;
      points->SetData(coordinates);
      polyData->SetPoints(points);
    }
    for (const ArrayName& wanted : kArrays)
    {
      const bool ofPoints = std::strcmp(wanted.parent, "PointData") == 0;
      vtkFieldData* const data = ofPoints ? polyData->GetPointData() : polyData->GetFieldData();
      const pugi::xml_node node = Node(wanted);
      if (!node)
      {
        continue;
      }
      if (std::strcmp(wanted.ownType, "Float64") == 0)
      {
        data->AddArray(ReadFloating(node, wanted.name, ofPoints ? points_ : 1));
      }
      else if (std::strcmp(wanted.ownType, "Int32") == 0)
      {
        vtkNew<vtkIntArray> numbers;
        ReadNumbers(node, wanted.name, 1, numbers.Get());
        data->AddArray(numbers);
      }
      else
      {
        vtkNew<vtkStringArray> strings;
        ReadStrings(node, wanted.name, strings);
        data->AddArray(strings);
      }
    }
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

  FileError Damaged(const std::string& what) const
  {
    return FormatError(name_ + ": " + what + " is damaged, truncated or of another size than stated");
  }

  FileError TooMuchText(const std::string& what) const
  {
    return FormatError(name_ + ": " + what + " has more than " + std::to_string(mostTextBytes) + " bytes or " +
                       std::to_string(mostStrings) + " lines; shorten or remove it");
  }

  pugi::xml_node PointsNode() const { return piece_.child("Points").child("DataArray"); }

  pugi::xml_node Node(const ArrayName& wanted) const
  {
    const pugi::xml_node parent =
        std::strcmp(wanted.parent, "PointData") == 0 ? piece_.child("PointData") : polyData_.child("FieldData");
    const bool string = std::strcmp(wanted.ownType, "String") == 0;
    return parent.find_child_by_attribute(string ? "Array" : "DataArray", "Name", wanted.name);
  }

  // Refuses what is no encoding of VTK's, because that is damage, and tells ours from the others.
  void FindEncoding(pugi::xml_node root, bool raw)
  {
    for (const pugi::xml_attribute& attribute : root.attributes())
    {
      if (!IsOneOf(attribute.name(), {"type", "version", "byte_order", "header_type", "compressor"}))
      {
        throw FormatError(name_ + ": VTKFile has the attribute " + Quoted(attribute.name()) + ", which is not known");
      }
    }
    const std::string order = root.attribute("byte_order").value();
    const std::string header = root.attribute("header_type").value();
    const std::string compressor = root.attribute("compressor").value();
    if (!IsOneOf(order, {"LittleEndian", "BigEndian"}) || !IsOneOf(header, {"", "UInt32", "UInt64"}) ||
        !IsOneOf(compressor, {"", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "vtkLZMADataCompressor"}))
    {
      throw FormatError(name_ + ": byte_order " + Quoted(order) + ", header_type " + Quoted(header) +
                        " and compressor " + Quoted(compressor) + " are no encoding of VTK's");
    }
    ours_ = raw && header == "UInt64" && compressor == "vtkZLibDataCompressor" &&
            order == (kThisMachineIsBigEndian ? "BigEndian" : "LittleEndian");
    const auto look = [this](pugi::xml_node node, const char* name, const std::string& ownType)
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
      if (!PointsNode())
      {
        throw FormatError(name_ + ": the array Points is missing");
      }
      look(PointsNode(), "Points", "Float64");
    }
    for (const ArrayName& wanted : kArrays)
    {
      if (Node(wanted))
      {
        look(Node(wanted), wanted.name, wanted.ownType);
      }
    }
  }

  vtkSmartPointer<vtkDataArray> ReadFloating(pugi::xml_node node, const char* name, std::int64_t tuples)
  {
    const auto read = [&](auto array)
    {
      ReadNumbers(node, name, tuples, array.Get());
      return vtkSmartPointer<vtkDataArray>(array);
    };
    return std::strcmp(node.attribute("type").value(), "Float32") == 0 ? read(vtkSmartPointer<vtkFloatArray>::New())
                                                                       : read(vtkSmartPointer<vtkDoubleArray>::New());
  }

  // `tuples` is what an array of the piece has; the array's own word goes before it.
  template <class Array>
  void ReadNumbers(pugi::xml_node node, const char* name, std::int64_t tuples, Array* array)
  {
    std::int64_t components = 1;
    const pugi::xml_attribute statedTuples = node.attribute("NumberOfTuples");
    const pugi::xml_attribute statedComponents = node.attribute("NumberOfComponents");
    if ((statedTuples && (!ParseNumber(statedTuples.value(), tuples) || tuples < 0 || tuples > mostPoints)) ||
        (statedComponents &&
         (!ParseNumber(statedComponents.value(), components) || components < 1 || components > mostComponents)))
    {
      throw FormatError(name_ + ": " + name + " claims " + Quoted(statedTuples.value()) + " tuples of " +
                        Quoted(statedComponents.value()) + " components");
    }
    const Blocks blocks = FindBlocks(node, name);
    if (blocks.total != static_cast<std::uint64_t>(tuples * components) * sizeof(typename Array::ValueType))
    {
      throw Damaged(name);
    }
    array->SetName(name);
    array->SetNumberOfComponents(static_cast<int>(components));
    array->SetNumberOfTuples(tuples);
    Inflate(blocks, name, array->GetPointer(0));
  }

  // Strings are stored one after the other, each with a zero at its end.
  void ReadStrings(pugi::xml_node node, const char* name, vtkStringArray* strings)
  {
    const Blocks blocks = FindBlocks(node, name);
    if (blocks.total > mostTextBytes)
    {
      throw TooMuchText(name);
    }
    std::string bytes(blocks.total, '\0');
    Inflate(blocks, name, bytes.data());
    if (std::count(bytes.begin(), bytes.end(), '\0') > mostStrings)
    {
      throw TooMuchText(name);
    }
    strings->SetName(name);
    for (std::size_t begin = 0; begin < bytes.size();)
    {
      const std::size_t end = std::min(bytes.find('\0', begin), bytes.size());
      strings->InsertNextValue(bytes.substr(begin, end - begin));
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
  Blocks FindBlocks(pugi::xml_node node, const std::string& what) const
  {
    std::int64_t offset = -1;
    if (!ParseNumber(node.attribute("offset").value(), offset) || offset < 0 ||
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

  // `out` has room for blocks.total bytes.
  void Inflate(Blocks blocks, const std::string& what, void* out) const
  {
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
        throw Damaged(what);
      }
      blocks.data.remove_prefix(size);
      done += room;
    }
  }

  std::string name_;
  std::string text_;
  pugi::xml_document document_;
  pugi::xml_node polyData_;
  pugi::xml_node piece_;
  std::string_view appended_;
  std::int64_t points_ = 0;
  bool ours_ = false;
};

// The first complaint, without the place in VTK's source and the object's address.
void KeepComplaint(vtkObject*, unsigned long, void* clientData, void* callData)
{
  std::string& kept = *static_cast<std::string*>(clientData);
  if (kept.empty())
  {
    const std::string text = callData ? static_cast<const char*>(callData) : "it gives no reason";
    const std::size_t begin = text.find("): ");
    kept = Trimmed(std::string_view(text).substr(begin == std::string::npos ? 0 : begin + 3));
  }
}

void ReadWithVtk(const std::string& fileName, vtkPolyData* polyData)
{
  std::string complaint;
  vtkNew<vtkCallbackCommand> observer;
  observer->SetCallback(KeepComplaint);
  observer->SetClientData(&complaint);
  vtkNew<vtkXMLPolyDataReader> reader;
  reader->AddObserver(vtkCommand::ErrorEvent, observer);
  reader->GetExecutive()->AddObserver(vtkCommand::ErrorEvent, observer);
  reader->SetReaderErrorObserver(observer);
  reader->SetParserErrorObserver(observer);
  reader->SetFileName(fileName.c_str());
  reader->Update();
  if (!complaint.empty() || reader->GetErrorCode() != vtkErrorCode::NoError)
  {
    throw FormatError(fileName +
                      ": VTK's reader refuses it: " + (complaint.empty() ? "it gives no reason" : complaint));
  }
  polyData->ShallowCopy(reader->GetOutput());
}

// The array in 32 bits if that holds every value, else itself.
vtkSmartPointer<vtkDataArray> AsFloats(vtkDataArray* array)
{
  vtkDoubleArray* const doubles = vtkDoubleArray::SafeDownCast(array);
  const vtkIdType count = doubles ? doubles->GetNumberOfValues() : 0;
  const double* const values = count > 0 ? doubles->GetPointer(0) : nullptr;
  // What lies beyond the range of a float must not be converted to one.
  const auto fits = [](double value)
  {
    return std::abs(value) <= std::numeric_limits<float>::max() &&
           static_cast<double>(static_cast<float>(value)) == value;
  };
  if (!values || !std::all_of(values, values + count, fits))
  {
    return array;
  }
  const auto floats = vtkSmartPointer<vtkFloatArray>::New();
  floats->DeepCopy(array);
  return floats;
}

}  // namespace

bool IsOwnVtp(const std::string& fileName)
{
  return VtpFile(fileName).IsOurs();
}

void ReadVtp(const std::string& fileName, vtkPolyData* field)
{
  VtpFile file(fileName);
  if (file.IsOurs())
  {
    file.Fill(field);
  }
  else
  {
    ReadWithVtk(fileName, field);
  }
}

bool WriteVtp(vtkPolyData* field, const std::string& fileName)
{
  vtkNew<vtkPolyData> narrow;
  narrow->ShallowCopy(field);
  if (field->GetPoints())
  {
    vtkNew<vtkPoints> points;
    points->SetData(AsFloats(field->GetPoints()->GetData()));
    narrow->SetPoints(points);
  }
  narrow->GetPointData()->Initialize();
  for (int k = 0; k < field->GetPointData()->GetNumberOfArrays(); ++k)
  {
    narrow->GetPointData()->AddArray(AsFloats(field->GetPointData()->GetArray(k)));
  }
  narrow->GetPointData()->SetActiveScalars("Reflectivity");
  if (field->GetNumberOfPoints() <= VTK_INT_MAX)
  {
    narrow->GetVerts()->ConvertTo32BitStorage();
  }
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetFileName(fileName.c_str());
  writer->SetInputData(narrow);
  writer->SetDataModeToAppended();
  writer->EncodeAppendedDataOff();
  writer->SetCompressorTypeToZLib();
  writer->SetHeaderTypeToUInt64();
  return writer->Write() && writer->GetErrorCode() == vtkErrorCode::NoError;
}

}  // namespace bigus
