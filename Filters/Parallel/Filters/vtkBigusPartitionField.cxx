// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusPartitionField.h"

#include "Core/Model/Error.h"
#include "Data/FieldData.h"
#include "Data/Provenance.h"
#include "PipelineSupport.h"
#include "vtkErrorCode.h"
#include "vtkFieldData.h"
#include "vtkInformation.h"
#include "vtkInformationIntegerKey.h"
#include "vtkInformationVector.h"
#include "vtkObjectFactory.h"
#include "vtkPolyData.h"
#include "vtkStreamingDemandDrivenPipeline.h"

vtkStandardNewMacro(vtkBigusPartitionField);

void vtkBigusPartitionField::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "NumberOfChunks: " << this->NumberOfChunks << "\n";
  os << indent << "NumberOfPieces: " << this->NumberOfPieces << "\n";
  os << indent << "Piece: " << this->Piece << "\n";
}

int vtkBigusPartitionField::RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputs)
{
  outputs->GetInformationObject(0)->Remove(bigus::ChunksOfPiecesKey());
  return 1;
}

int vtkBigusPartitionField::RequestUpdateExtent(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector*)
{
  bigus::RequestWholeInput(inputs[0]);
  vtkInformation* info = inputs[0]->GetInformationObject(0);
  this->IsInputAPart = this->Piece >= 0 && this->Piece < this->NumberOfPieces &&
                       info->Get(bigus::ChunksOfPiecesKey()) == this->NumberOfChunks;
  if (this->IsInputAPart)
  {
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_PIECE_NUMBER(), this->Piece);
    info->Set(vtkStreamingDemandDrivenPipeline::UPDATE_NUMBER_OF_PIECES(), this->NumberOfPieces);
  }
  return 1;
}

int vtkBigusPartitionField::RequestData(vtkInformation*, vtkInformationVector** inputs, vtkInformationVector* outputs)
{
  vtkPolyData* output = vtkPolyData::GetData(outputs);
  const auto work = [&]
  {
    vtkPolyData* input = vtkPolyData::GetData(inputs[0]);
    bigus::RequirePartition(this->NumberOfChunks, this->Piece, this->NumberOfPieces);
    if (this->IsInputAPart && input->GetFieldData()->GetArray(bigus::kChunksArray))
    {
      output->ShallowCopy(input);
      return;
    }
    bigus::Require(!this->IsInputAPart || this->NumberOfPieces <= 1,
                   "The reader could not read this part of the field.");
    bigus::FieldChunks chunks = bigus::ChunksOfPiece(this->NumberOfChunks, this->Piece, this->NumberOfPieces);
    const bigus::GaussianField part = bigus::PartOf(bigus::FieldFromPolyData(input), chunks);
    bigus::FieldToPolyData(part, output);
    if (const auto view = bigus::ViewFromPolyData(input))
    {
      bigus::ViewToPolyData(bigus::PartOf(*view, chunks), output);
    }
    bigus::ReplaceProvenance(output, bigus::ProvenanceOf(input));
    bigus::WriteChunks(chunks, output);
  };
  return bigus::Execute(this, outputs, work);
}
