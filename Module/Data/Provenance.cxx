// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Data/Provenance.h"

#include <algorithm>
#include <cctype>
#include <string>

#include "Core/Deciding/Trainer.h"
#include "Core/Engine/InstructionSets.h"
#include "Core/Training/OptionList.h"
#include "vtkDataObject.h"
#include "vtkFieldData.h"
#include "vtkNew.h"
#include "vtkStringArray.h"

namespace bigus
{
namespace
{

bool HasKey(const std::string& line, const std::string& key)
{
  return line.compare(0, key.size(), key) == 0 && line.size() > key.size() && line[key.size()] == '=';
}

}  // namespace

std::vector<std::string> ProvenanceOf(vtkDataObject* data)
{
  auto* array = vtkStringArray::SafeDownCast(data->GetFieldData()->GetAbstractArray("Provenance"));
  std::vector<std::string> lines;
  for (vtkIdType i = 0; array && i < array->GetNumberOfValues(); ++i)
  {
    lines.push_back(array->GetValue(i));
  }
  return lines;
}

void ReplaceProvenance(vtkDataObject* data, const std::vector<std::string>& lines)
{
  if (lines.empty())
  {
    data->GetFieldData()->RemoveArray("Provenance");
    return;
  }
  vtkNew<vtkStringArray> array;  // a new one, because another data object may share the old one
  array->SetName("Provenance");
  for (const std::string& line : lines)
  {
    array->InsertNextValue(line);
  }
  data->GetFieldData()->AddArray(array);
}

void SetProvenance(vtkDataObject* data, const std::string& key, const std::string& value)
{
  std::vector<std::string> lines = ProvenanceOf(data);
  lines.erase(std::remove_if(lines.begin(), lines.end(), [&key](const std::string& line) { return HasKey(line, key); }),
              lines.end());
  lines.push_back(key + "=" + value);
  ReplaceProvenance(data, lines);
}

std::string GetProvenance(vtkDataObject* data, const std::string& key)
{
  for (const std::string& line : ProvenanceOf(data))
  {
    if (HasKey(line, key))
    {
      return line.substr(key.size() + 1);
    }
  }
  return "";
}

void SetTrainingProvenance(vtkDataObject* data, const TrainingResult& result)
{
  for (const OptionText& option : ListOptions(result.settled))
  {
    if (!(option.mayBeOpen && option.value == "auto"))
    {
      std::string key = option.info.name;
      key[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(key[0])));
      SetProvenance(data, key, option.value);
    }
  }
  // The same field comes back only with these, whatever the number of threads.
  SetProvenance(data, "instructionSet", InstructionSets().front());
  // What came of it, rather than what was asked for.
  SetProvenance(data, "gaussians", std::to_string(result.field.Size()));
  SetProvenance(data, "iterations", std::to_string(result.iterations));
  SetProvenance(data, "aborted", result.aborted ? "yes" : "no");
  for (const Decision& decision : result.decisions)
  {
    SetProvenance(data, "decision." + decision.what, decision.choice + " (" + decision.evidence + ")");
  }
}

}  // namespace bigus
