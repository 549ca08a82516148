// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusFieldWriter.h"

#include <string>

#include "Core/Model/Error.h"
#include "Core/Model/FieldRounding.h"
#include "Data/FieldData.h"
#include "Data/LabelData.h"
#include "Data/Processes.h"
#include "Data/Provenance.h"
#include "IO/ErrorCode.h"
#include "IO/FieldFile.h"
#include "vtkInformation.h"
#include "vtkMultiProcessController.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"

vtkStandardNewMacro(vtkBigusFieldWriter);

vtkBigusFieldWriter::vtkBigusFieldWriter() : FileName(nullptr), NumberOfPieces(bigus::FieldChunks::kUsual) {}

vtkBigusFieldWriter::~vtkBigusFieldWriter()
{
  this->SetFileName(nullptr);
  this->SetController(nullptr);
}

vtkCxxSetObjectMacro(vtkBigusFieldWriter, Controller, vtkMultiProcessController);

int vtkBigusFieldWriter::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData");
  return 1;
}

vtkPolyData* vtkBigusFieldWriter::GetInput()
{
  return vtkPolyData::SafeDownCast(this->GetInputDataObject(0, 0));
}

#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
bool vtkBigusFieldWriter::WriteDataAndReturn()
{
  this->WriteFile();
  return this->GetErrorCode() == vtkErrorCode::NoError;
}
#else
void vtkBigusFieldWriter::WriteData()
{
  this->WriteFile();
}
#endif

int vtkBigusFieldWriter::Write()
{
  this->HasTold = false;
  const int done = this->Superclass::Write();
  // Where the input cannot be made there was nothing to write, and the others wait for this process.
  if (!this->HasTold && this->Controller && this->Controller->GetNumberOfProcesses() > 1)
  {
    this->Together([](bigus::Exchange&) { throw bigus::Error("its part of the field could not be made"); });
    return 0;
  }
  return done;
}

void vtkBigusFieldWriter::Together(const std::function<void(bigus::Exchange&)>& work)
{
  this->HasTold = true;
  try
  {
    const std::unique_ptr<bigus::Exchange> processes = bigus::ExchangeOf(this->Controller);
    processes->Together([&] { work(*processes); });
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< bigus::MessageOf(error));
    this->SetErrorCode(bigus::ErrorCodeOf(error));
  }
}

void vtkBigusFieldWriter::WriteFile()
{
  this->Together(
      [this](bigus::Exchange& processes)
      {
        bigus::Require(bigus::FileFault::NoName, this->FileName && *this->FileName, "FileName is not set");
        const std::string fileName = this->FileName;
        bigus::RequireFieldName(fileName);
        vtkPolyData* const input = this->GetInput();
        bigus::StoredField stored = {
            bigus::FieldFromPolyData(input), bigus::ProvenanceOf(input), {}, bigus::StandardErrorOf(input)};
        stored.view = bigus::ViewFromPolyData(input);
        if (processes.IsAlone() && bigus::KeepsLabels(fileName))
        {
          stored.labels = bigus::LabelsFromPolyData(input);
        }
        else if (input->GetPointData()->GetArray("LabelWeight"))
        {
          vtkWarningMacro(<< fileName << ": the field's labels are left out; .vtp keeps it.");
        }
        if (this->Rounding)
        {
          bigus::RoundField(stored.field);
          if (stored.view)
          {
            bigus::RoundView(*stored.view);
          }
        }
        if (processes.IsAlone())
        {
          bigus::WriteField(stored, fileName, this->NumberOfPieces);
        }
        else
        {
          bigus::WriteFieldTogether(stored, fileName, processes);
        }
      });
}

void vtkBigusFieldWriter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  os << indent << "FileName: " << (this->FileName ? this->FileName : "(none)") << "\n";
  os << indent << "Rounding: " << this->Rounding << "\n";
  os << indent << "NumberOfPieces: " << this->NumberOfPieces << "\n";
  os << indent << "Controller: " << this->Controller << "\n";
}
