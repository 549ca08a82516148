// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPartitionField.h"

#include <string>
#include <vector>

#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "FieldParts.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusPartitionField);

namespace
{

void CheckNumbers(int chunks, int piece, int pieces)
{
  if (chunks < 1 || chunks > bigus::FieldChunks::kMost || (chunks & (chunks - 1)) != 0)
  {
    throw bigus::Error("NumberOfChunks is " + std::to_string(chunks) + "; it must be a power of two from 1 to " +
                       std::to_string(bigus::FieldChunks::kMost) + ".");
  }
  if (pieces < 1 || piece < 0 || piece >= pieces)
  {
    throw bigus::Error("Piece is " + std::to_string(piece) + " of NumberOfPieces " + std::to_string(pieces) +
                       "; pieces are counted from 0.");
  }
}

}  // namespace

void vtkBigusPartitionField::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "NumberOfChunks: " << this->NumberOfChunks << "\n";
  os << indent << "NumberOfPieces: " << this->NumberOfPieces << "\n";
  os << indent << "Piece: " << this->Piece << "\n";
}

int vtkBigusPartitionField::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  return 1;
}

int vtkBigusPartitionField::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* output = vtkPolyData::GetData(outputs);
  this->SetErrorCode(vtkErrorCode::NoError);
  try
  {
    vtkPolyData* input = vtkPolyData::GetData(inputs[0]);
    CheckNumbers(this->NumberOfChunks, this->Piece, this->NumberOfPieces);
    const bigus::GaussianField field = bigus::FieldFromPolyData(input);
    bigus::FieldChunks chunks = bigus::ChunksOfPiece(this->NumberOfChunks, this->Piece, this->NumberOfPieces);
    bigus::GaussianField part;
    part.beam = field.beam;
    part.transfer = field.transfer;
    for (std::size_t k = 0; k < chunks.sizes.size(); ++k)
    {
      for (std::size_t i = 0; i < field.Size(); ++i)
      {
        if (bigus::ChunkOf(i, chunks.total) == chunks.first + static_cast<int>(k))
        {
          part.means.push_back(field.means[i]);
          part.scales.push_back(field.scales[i]);
          part.rotations.push_back(field.rotations[i]);
          part.reflectivities.push_back(field.reflectivities[i]);
          ++chunks.sizes[k];
        }
      }
    }
    bigus::FieldToPolyData(part, output);
    bigus::ReplaceProvenance(output, bigus::ProvenanceOf(input));
    bigus::WriteChunks(chunks, output);
    return 1;
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    bigus::ForgetRequests(outputs);
    vtkErrorMacro(<< error.what());
    this->SetErrorCode(vtkErrorCode::UserError);
    return 0;
  }
}
