// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// One .pvtp that several processes write, each a piece, by threads in place of processes.
#include <gtest/gtest.h>

#include <filesystem>

#include "Core/Model/Error.h"
#include "IO/FieldFile.h"
#include "Support/Fields.h"
#include "Support/Random.h"
#include "Support/TestSupport.h"
#include "ThreadExchange.h"
#include "vtkNew.h"
#include "vtkPointData.h"
#include "vtkPolyData.h"
#include "vtkXMLPPolyDataReader.h"

namespace bigus::test
{
namespace
{

constexpr std::size_t kGaussians = 2000;

GaussianField Field(std::size_t count)
{
  Random random(5);
  GaussianField field = RandomField(random, count, 10.0, 0.1, 1.0, 0.4);
  field.transfer.gamma = 0.7;
  field.beam = {0.25, 0.5, {{0, 0, 1}}};
  return field;
}

/// A quarter of the field, in its order.
GaussianField Quarter(GaussianField field, int rank)
{
  const auto keep = [rank](auto& values)
  {
    const auto quarter = static_cast<std::ptrdiff_t>(values.size() / 4);
    values = {values.begin() + rank * quarter, values.begin() + (rank + 1) * quarter};
  };
  keep(field.means);
  keep(field.scales);
  keep(field.rotations);
  keep(field.reflectivities);
  return field;
}

/// One recorded frame, and of each Gaussian a q that tells which one it is.
ViewDependence ViewOf(const GaussianField& field)
{
  ViewDependence view;
  view.views.unit = 0.5;
  view.views.angleStep = 1;
  view.views.elevationStep = 2;
  view.views.poses.assign(1, Eigen::Matrix4d::Identity());
  for (const Eigen::Vector3d& mean : field.means)
  {
    view.terms.emplace_back(mean[2], 2 * mean[0], -mean[1]);
  }
  return view;
}

TEST(Together, ProcessesWriteTheirParts)
{
  const TemporaryFolder folder;
  const GaussianField field = Field(kGaussians);
  const std::string index = folder / "field.pvtp";
  const auto write = [&](Exchange& processes)
  {
    StoredField part = {Quarter(field, processes.Rank()), {}, {}};
    part.view = ViewOf(part.field);
    WriteFieldTogether(part, index, processes);
  };
  EXPECT_EQ(InThreads(4, write), std::vector<std::string>(4));
  const StoredField stored = *ReadField(index);
  ASSERT_TRUE(stored.view);
  EXPECT_EQ(stored.view->terms, ViewOf(field).terms);
  EXPECT_TRUE(stored.view->views == ViewOf(field).views);
  const GaussianField& read = stored.field;
  EXPECT_TRUE(SameField(read, field));
  EXPECT_EQ(read.transfer.gamma, field.transfer.gamma);
  EXPECT_EQ(read.beam.elevationSigma, field.beam.elevationSigma);
  EXPECT_EQ(read.beam.probeElevationSigma, field.beam.probeElevationSigma);
  EXPECT_EQ(read.beam.trainedNormals, field.beam.trainedNormals);
  vtkNew<vtkXMLPPolyDataReader> vtk;
  vtk->SetFileName(index.c_str());
  vtk->Update();
  EXPECT_EQ(vtk->GetOutput()->GetNumberOfPoints(), static_cast<vtkIdType>(kGaussians));
  ASSERT_TRUE(vtk->GetOutput()->GetPointData()->GetArray("ViewTerm"));
}

TEST(Together, AFailedWriteLeavesWhatWas)
{
  const TemporaryFolder folder;
  WriteField({Field(600), {}, {}}, folder / "field.pvtp", 2);
  const StoredField other = {Field(700), {}, {}};
  for (const auto& [name, words] :
       {std::pair("field.vtp", "name the file so"), std::pair("field.pvtp", "same Gaussians"),
        std::pair("field.pvtp", "recorded views")})
  {
    const bool knowsMore = std::string(words) == "recorded views";
    const auto errors = InThreads(2,
                                  [&](Exchange& processes)
                                  {
                                    StoredField part = other;
                                    if (knowsMore && processes.Rank() == 1)
                                    {
                                      part.view = ViewOf(part.field);
                                    }
                                    WriteFieldTogether(part, folder / name, processes);
                                  });
    EXPECT_NE(errors[0].find(words), std::string::npos) << errors[0];
    EXPECT_NE(errors[1].find(words), std::string::npos) << errors[1];
  }
  EXPECT_EQ(ReadField(folder / "field.pvtp")->field.Size(), 600u);
  for (const auto& entry : std::filesystem::directory_iterator(folder.Path()))
  {
    EXPECT_EQ(entry.path().string().find("bigus-part"), std::string::npos) << entry.path();
  }
}

}  // namespace
}  // namespace bigus::test
