// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldReader.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/Provenance.h"
#include "IO/ErrorCode.h"
#include "IO/FieldFile.h"
#include "IO/Text.h"
#include "vtkCallbackCommand.h"
#include "vtkExecutive.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkInformationVector.h"
#include "vtkNew.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkXMLPolyDataReader.h"

vtkStandardNewMacro(vtkBigusFieldReader);

namespace
{

// The first complaint, without the place in VTK's source and the object's address.
void KeepComplaint(vtkObject*, unsigned long, void* clientData, void* callData)
{
  std::string& kept = *static_cast<std::string*>(clientData);
  if (kept.empty())
  {
    const std::string text = callData ? static_cast<const char*>(callData) : "it gives no reason";
    const std::size_t begin = text.find("): ");
    kept = bigus::Trimmed(std::string_view(text).substr(begin == std::string::npos ? 0 : begin + 3));
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
    throw bigus::FormatError(fileName +
                             ": VTK's reader refuses it: " + (complaint.empty() ? "it gives no reason" : complaint));
  }
  polyData->ShallowCopy(reader->GetOutput());
}

void ToPolyData(const bigus::StoredField& stored, vtkPolyData* output)
{
  bigus::FieldToPolyData(stored.field, output);
  if (stored.view)
  {
    bigus::ViewToPolyData(*stored.view, output);
  }
  if (stored.labels)
  {
    bigus::LabelsToPolyData(*stored.labels, output);
  }
  bigus::ReplaceProvenance(output, stored.provenance);
  bigus::ReplaceStandardError(output, stored.standardError);
  if (stored.chunks)
  {
    bigus::WriteChunks(*stored.chunks, output);
  }
}

/// Leaves only the Gaussians of a piece in a whole field.
void KeepPart(const bigus::FieldPiece& piece, vtkPolyData* output)
{
  const std::vector<std::string> provenance = bigus::ProvenanceOf(output);
  bigus::FieldChunks chunks = bigus::ChunksOfPiece(piece.chunks, piece.piece, piece.pieces);
  const std::optional<bigus::ViewDependence> view = bigus::ViewFromPolyData(output);
  bigus::FieldToPolyData(bigus::PartOf(bigus::FieldFromPolyData(output), chunks), output);
  if (view)
  {
    bigus::ViewToPolyData(bigus::PartOf(*view, chunks), output);
  }
  bigus::ReplaceProvenance(output, provenance);
  bigus::WriteChunks(chunks, output);
}

}  // namespace

vtkBigusFieldReader::vtkBigusFieldReader() : FileName(nullptr), NumberOfChunks(bigus::FieldChunks::kUsual)
{
  this->SetNumberOfInputPorts(0);
}

vtkBigusFieldReader::~vtkBigusFieldReader()
{
  this->SetFileName(nullptr);
}

int vtkBigusFieldReader::CanReadFile(const char* fileName)
{
  return fileName && bigus::IsField(fileName) ? 1 : 0;
}

int vtkBigusFieldReader::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkInformation* const info = outputVector->GetInformationObject(0);
  info->Set(vtkAlgorithm::CAN_HANDLE_PIECE_REQUEST(), 1);
  int chunks = 0;
  try
  {
    chunks = this->FileName ? bigus::ChunksOfFile(this->FileName, this->NumberOfChunks) : 0;
  }
  catch (const std::exception&)
  {
    // Reading says what is wrong.
  }
  info->Set(bigus::ChunksOfPiecesKey(), chunks);
  return 1;
}

int vtkBigusFieldReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkPolyData* const output = vtkPolyData::GetData(outputVector, 0);
  output->Initialize();
  this->SetErrorCode(vtkErrorCode::NoError);
  vtkInformation* const info = outputVector->GetInformationObject(0);
  bigus::FieldPiece piece;
  piece.chunks = this->NumberOfChunks;
  if (info->Has(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES()))
  {
    piece.piece = info->Get(vtkStreamingDemandDrivenPipeline::UPDATE_PIECE_NUMBER());
    piece.pieces = std::max(1, info->Get(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES()));
  }
  try
  {
    bigus::Require(bigus::FileFault::NoName, this->FileName && *this->FileName, "FileName is not set");
    const std::string fileName = this->FileName;
    const auto foreign = [](const std::string& file)
    {
      vtkNew<vtkPolyData> part;
      ReadWithVtk(file, part);
      return bigus::StoredField{
          bigus::FieldFromPolyData(part), bigus::ProvenanceOf(part), {}, {}, bigus::ViewFromPolyData(part)};
    };
    if (const auto stored = bigus::ReadField(fileName, piece, foreign))
    {
      ToPolyData(*stored, output);
      return 1;
    }
    ReadWithVtk(fileName, output);
    try
    {
      const std::string standardError = bigus::StandardErrorOf(output);
      bigus::ShareField(output, output);
      if (piece.pieces > 1)
      {
        KeepPart(piece, output);
      }
      bigus::ReplaceStandardError(output, standardError);
    }
    catch (const bigus::Error& error)  // what is wrong with the field
    {
      throw bigus::FormatError(fileName + ": " + error.what());
    }
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< bigus::MessageOf(error));
    this->SetErrorCode(bigus::ErrorCodeOf(error));
    output->Initialize();
    // Filters that other processes wait for must run and tell them. A piece without `Chunks` says that it failed.
    return piece.pieces > 1 ? 1 : 0;
  }
  return 1;
}

void vtkBigusFieldReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FileName: " << (this->FileName ? this->FileName : "(none)") << "\n";
  os << indent << "NumberOfChunks: " << this->NumberOfChunks << "\n";
}
