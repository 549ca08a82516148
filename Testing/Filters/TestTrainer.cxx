// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// vtkBigusTrainer: a filter around the trainer; what is learned is tested with Core.

#include <map>
#include <sstream>

#include "Core/Training/OptionList.h"
#include "Filters/FilterTestSupport.h"
#include "vtkBigusImageMetrics.h"
#include "vtkBigusReslice.h"
#include "vtkBigusTrainer.h"
#include "vtkCallbackCommand.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkIntArray.h"
#include "vtkTable.h"
#include "vtkUnsignedCharArray.h"
#include "vtkVariant.h"

namespace bigus::test
{
namespace
{

/// Twelve frames of 48 x 40 pixels, 0.4 mm apart, that look at a soft pattern; tilted in the world.
vtkSmartPointer<vtkImageData> PatternSweep()
{
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(48, 40, 12);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  vtkNew<vtkDoubleArray> poses;
  poses->SetName("ImageToReference");
  poses->SetNumberOfComponents(16);
  const Eigen::Matrix4d tilt = RigidMatrix(RandomRotation(3), {20, -30, 5});
  for (int k = 0; k < 12; ++k)
  {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 0) = pose(1, 1) = 0.3;
    pose(2, 3) = 0.4 * k;
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> world = tilt * pose;
    poses->InsertNextTypedTuple(world.data());
    for (int j = 0; j < 40; ++j)
    {
      for (int i = 0; i < 48; ++i)
      {
        const double value = 0.4 + 0.2 * std::sin(0.5 * i + 0.3 * k) + 0.15 * std::cos(0.4 * j - 0.2 * k);
        *static_cast<unsigned char*>(image->GetScalarPointer(i, j, k)) = static_cast<unsigned char>(255 * value);
      }
    }
  }
  image->GetFieldData()->AddArray(poses);
  return image;
}

/// A trainer that takes a moment and decides nothing.
struct Quick
{
  vtkSmartPointer<vtkImageData> sweep = PatternSweep();
  vtkNew<vtkBigusTrainer> trainer;
  Quick()
  {
    trainer->SetInputData(sweep);
    trainer->AutomaticOff();
    trainer->SetGaussians(1500);
    trainer->SetIterations(60);
    trainer->SetHoldOut(4);
  }
};

/// As many as Quick seeds, but for those that no plane shows, which training removes.
bool OfAbout1500(vtkPolyData* field)
{
  return field->GetNumberOfPoints() <= 1500 && field->GetNumberOfPoints() > 1450;
}

std::vector<int> Values(vtkIntArray* list)
{
  return {list->GetPointer(0), list->GetPointer(0) + list->GetNumberOfValues()};
}

/// PSNR of the field's image of one frame.
double PsnrAt(vtkPolyData* field, vtkImageData* sweep, int frame)
{
  vtkNew<vtkBigusReslice> reslice;
  vtkNew<vtkMatrix4x4> axes;
  axes->DeepCopy(
      vtkDoubleArray::SafeDownCast(sweep->GetFieldData()->GetArray("ImageToReference"))->GetPointer(16 * frame));
  reslice->SetInputData(field);
  reslice->SetOutputToFrame(axes, 48, 40);
  reslice->Update();
  vtkNew<vtkImageData> truth;
  truth->SetDimensions(48, 40, 1);
  truth->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  std::memcpy(truth->GetScalarPointer(), sweep->GetScalarPointer(0, 0, frame), 48 * 40);
  vtkNew<vtkBigusImageMetrics> metrics;
  metrics->SetInputData(reslice->GetOutput());
  metrics->SetTruthData(truth);
  metrics->Update();
  return metrics->GetPSNR();
}

TEST(Trainer, LearnsAFieldThatPredictsFramesItHasNotSeen)
{
  Quick quick;
  quick.trainer->Update();
  vtkPolyData* field = quick.trainer->GetOutput();
  ASSERT_TRUE(OfAbout1500(field));
  EXPECT_NO_THROW(FieldFromPolyData(field));
  EXPECT_EQ(Values(quick.trainer->GetHeldOutFrames()), (std::vector<int>{2, 6, 10}));
  EXPECT_EQ(Values(quick.trainer->GetTrainingFrames()), (std::vector<int>{0, 1, 3, 4, 5, 7, 8, 9, 11}));
  EXPECT_EQ(quick.trainer->GetIterationsDone(), 60);
  EXPECT_GT(quick.trainer->GetSeconds(), 0);
  EXPECT_NE(std::string(quick.trainer->GetDevice()), "");
  EXPECT_FALSE(quick.trainer->GetAborted());
  EXPECT_GT(PsnrAt(field, quick.sweep, 6), 25);

  vtkTable* log = quick.trainer->GetLog();
  ASSERT_GT(log->GetNumberOfRows(), 2);
  EXPECT_EQ(log->GetValueByName(log->GetNumberOfRows() - 1, "Iteration").ToInt(), 60);
  EXPECT_LT(log->GetValueByName(log->GetNumberOfRows() - 1, "Loss").ToDouble(),
            log->GetValueByName(0, "Loss").ToDouble());
  EXPECT_TRUE(std::isnan(log->GetValueByName(0, "ValidationPSNR").ToDouble()));

  EXPECT_EQ(GetProvenance(field, "seed"), "1");
  EXPECT_EQ(GetProvenance(field, "iterations"), "60");
  EXPECT_EQ(GetProvenance(field, "heldOutFrames"), "2 6 10");
}

TEST(Trainer, TheSameSeedGivesTheSameField)
{
  Quick a, b, c;
  for (Quick* quick : {&a, &b, &c})
  {
    quick->trainer->SetIterations(10);
  }
  c.trainer->SetSeed(2);
  a.trainer->Update();
  b.trainer->Update();
  c.trainer->Update();
  const GaussianField first = FieldFromPolyData(a.trainer->GetOutput());
  EXPECT_EQ(first.means, FieldFromPolyData(b.trainer->GetOutput()).means);
  EXPECT_EQ(first.reflectivities, FieldFromPolyData(b.trainer->GetOutput()).reflectivities);
  EXPECT_NE(first.means, FieldFromPolyData(c.trainer->GetOutput()).means);
}

TEST(Trainer, HeldOutAndRejectedFramesHaveNoPart)
{
  Quick clean;
  clean.trainer->SetIterations(10);
  clean.trainer->Update();
  Quick poisoned;
  poisoned.trainer->SetIterations(10);
  std::memset(poisoned.sweep->GetScalarPointer(0, 0, 6), 255, 48 * 40);
  poisoned.trainer->Update();
  EXPECT_EQ(FieldFromPolyData(clean.trainer->GetOutput()).means,
            FieldFromPolyData(poisoned.trainer->GetOutput()).means);

  Quick rejected;
  rejected.trainer->SetIterations(10);
  rejected.trainer->SetValidation(3);
  vtkNew<vtkDoubleArray> status;
  status->SetName("Status");
  for (int k = 0; k < 12; ++k)
  {
    status->InsertNextValue(k == 1 || k == 4 ? 0 : 1);
  }
  rejected.sweep->GetFieldData()->AddArray(status);
  rejected.trainer->Update();
  // Of the frames 0 2 3 5 6 7 8 9 10 11 that are left, numbers 2 and 6 are held out: frames 3 and 8.
  EXPECT_EQ(Values(rejected.trainer->GetHeldOutFrames()), (std::vector<int>{3, 8}));
  EXPECT_EQ(Values(rejected.trainer->GetValidationFrames()), (std::vector<int>{2, 7, 11}));
  EXPECT_EQ(Values(rejected.trainer->GetTrainingFrames()), (std::vector<int>{0, 5, 6, 9, 10}));
  EXPECT_FALSE(std::isnan(rejected.trainer->GetLog()->GetValueByName(0, "ValidationPSNR").ToDouble()));
}

TEST(Trainer, ContinuesFromAField)
{
  Quick first;
  first.trainer->SetIterations(20);
  first.trainer->Update();
  Quick second;
  second.trainer->SetInitialFieldConnection(first.trainer->GetOutputPort());
  second.trainer->Update();
  EXPECT_TRUE(OfAbout1500(second.trainer->GetOutput()));
  EXPECT_EQ(GetProvenance(second.trainer->GetOutput(), "seeding"), "continued");
  EXPECT_GT(PsnrAt(second.trainer->GetOutput(), second.sweep, 5), PsnrAt(first.trainer->GetOutput(), first.sweep, 5));

  second.trainer->SetIterations(0);
  second.trainer->Update();
  EXPECT_LT(
      (FieldFromPolyData(second.trainer->GetOutput()).means[7] - FieldFromPolyData(first.trainer->GetOutput()).means[7])
          .norm(),
      1e-4);
}

TEST(Trainer, AnAbortKeepsTheFieldSoFar)
{
  Quick quick;
  quick.trainer->SetIterations(1000000);
  struct Seen
  {
    int reports = 0;
    bool text = false;
  } seen;
  vtkNew<vtkCallbackCommand> stop;
  stop->SetClientData(&seen);
  stop->SetCallback(
      [](vtkObject* caller, unsigned long, void* data, void*)
      {
        auto* filter = vtkAlgorithm::SafeDownCast(caller);
        auto* state = static_cast<Seen*>(data);
        const char* text = filter->GetProgressText();
        state->text = state->text || (text && std::strstr(text, "iteration"));
        if (++state->reports == 40)
        {
          filter->SetAbortExecute(1);  // a million iterations would take hours
        }
      });
  quick.trainer->AddObserver(vtkCommand::ProgressEvent, stop);
  ErrorObserver errors(quick.trainer);
  quick.trainer->Update();
  EXPECT_TRUE(seen.text);
  EXPECT_TRUE(quick.trainer->GetAborted());
  EXPECT_TRUE(errors.Errors().empty());
  EXPECT_TRUE(OfAbout1500(quick.trainer->GetOutput()));
  EXPECT_EQ(GetProvenance(quick.trainer->GetOutput(), "aborted"), "yes");
}

TEST(Trainer, SignAndThicknessAreAsAsked)
{
  Quick quick;
  quick.trainer->SetIterations(20);
  quick.trainer->SignedReflectivityOff();
  quick.trainer->SetElevationSigma(0.7);
  quick.trainer->Update();
  const GaussianField field = FieldFromPolyData(quick.trainer->GetOutput());
  EXPECT_EQ(field.beam.elevationSigma, 0.7);
  EXPECT_GE(*std::min_element(field.reflectivities.begin(), field.reflectivities.end()), 0);
  quick.trainer->SetElevationSigma(-1);
  quick.trainer->Update();
  EXPECT_EQ(FieldFromPolyData(quick.trainer->GetOutput()).beam.elevationSigma, 0);
}

std::vector<std::string> Column(vtkTable* table, const char* name)
{
  std::vector<std::string> texts;
  for (vtkIdType row = 0; row < table->GetNumberOfRows(); ++row)
  {
    texts.push_back(table->GetValueByName(row, name).ToString());
  }
  return texts;
}

TEST(Trainer, SettledChoicesAreInTheProvenance)
{
  Quick quick;
  quick.trainer->SetIterations(10);
  quick.trainer->SetGaussians(-1);
  quick.trainer->Update();
  EXPECT_EQ(quick.trainer->GetDecisions()->GetNumberOfRows(), 0);
  EXPECT_EQ(quick.trainer->GetDecisions()->GetNumberOfColumns(), 4);
  vtkPolyData* field = quick.trainer->GetOutput();
  // 9 x 48 x 40 / 50 pixels, at least 1000, but for those that no plane shows.
  EXPECT_GT(field->GetNumberOfPoints(), 950);
  EXPECT_LE(field->GetNumberOfPoints(), 1000);
  EXPECT_EQ(GetProvenance(field, "gaussians"), std::to_string(field->GetNumberOfPoints()));
  EXPECT_EQ(GetProvenance(field, "loss"), "l1");
  EXPECT_EQ(GetProvenance(field, "elevationSigma"), "0");
  EXPECT_EQ(GetProvenance(field, "signedReflectivity"), "on");
  EXPECT_EQ(GetProvenance(field, "virtualPlanes"), "2");
  EXPECT_EQ(GetProvenance(field, "interpolation"), "normals");
  EXPECT_EQ(GetProvenance(field, "frameGains"), "off");

  quick.trainer->SetPreset("texture");
  quick.trainer->SetInterpolation("probe+flow");
  quick.trainer->SetVirtualPlanes(1);
  quick.trainer->FrameGainsOn();
  quick.trainer->Update();
  field = quick.trainer->GetOutput();
  EXPECT_NE(GetProvenance(field, "loss").find("contrast"), std::string::npos);
  EXPECT_EQ(GetProvenance(field, "interpolation"), "probe+flow");
  EXPECT_EQ(GetProvenance(field, "virtualPlanes"), "1");
  EXPECT_EQ(GetProvenance(field, "frameGains"), "on");

  quick.trainer->SetLoss("l2");  // wins over the preset
  quick.trainer->Update();
  EXPECT_EQ(GetProvenance(quick.trainer->GetOutput(), "loss"), "l2");
}

TEST(Trainer, DecidesWhatIsLeftOpenAndSaysWhy)
{
  Quick quick;
  quick.trainer->AutomaticOn();
  quick.trainer->SetElevationSigma(0.4);
  bool told = false;
  vtkNew<vtkCallbackCommand> listen;
  listen->SetClientData(&told);
  listen->SetCallback(
      [](vtkObject* caller, unsigned long, void* data, void*)
      {
        const char* text = vtkAlgorithm::SafeDownCast(caller)->GetProgressText();
        *static_cast<bool*>(data) |= text && std::strstr(text, "deciding");
      });
  quick.trainer->AddObserver(vtkCommand::ProgressEvent, listen);
  quick.trainer->Update();
  EXPECT_TRUE(told);
  vtkTable* decisions = quick.trainer->GetDecisions();
  const std::vector<std::string> whats = Column(decisions, "Decision");
  const std::vector<std::string> choices = Column(decisions, "Choice");
  const std::vector<std::string> evidences = Column(decisions, "Evidence");
  std::map<std::string, std::string> evidence;
  for (std::size_t i = 0; i < whats.size(); ++i)
  {
    evidence[whats[i]] = evidences[i];
    EXPECT_GE(decisions->GetValueByName(static_cast<vtkIdType>(i), "Seconds").ToDouble(), 0);
    EXPECT_EQ(GetProvenance(quick.trainer->GetOutput(), "decision." + whats[i]),
              choices[i] + " (" + evidences[i] + ")");
  }
  for (const char* given : {"Gaussians", "elevation sigma"})
  {
    EXPECT_EQ(evidence[given], "given") << given;
  }
  EXPECT_NE(evidence["interpolation"].find("dB"), std::string::npos) << evidence["interpolation"];
  EXPECT_FALSE(evidence["probe's beam"].empty());

  // A field to continue from was decided on before; poses are the sweep's.
  Quick second;
  second.trainer->AutomaticOn();
  second.trainer->SetInitialFieldConnection(quick.trainer->GetOutputPort());
  second.trainer->Update();
  EXPECT_EQ(Column(second.trainer->GetDecisions(), "Decision"), std::vector<std::string>{"poses"});
}

TEST(TrainerBadInput, OptionsOutOfRange)
{
  const auto expect = [](void (*change)(vtkBigusTrainer*), std::vector<std::string> parts)
  {
    Quick quick;
    change(quick.trainer);
    ExpectOneError(quick.trainer, parts);
    EXPECT_EQ(quick.trainer->GetLog()->GetNumberOfRows(), 0);
  };
  expect([](vtkBigusTrainer* f) { f->SetMaximumGaussians(0); }, {"maximum gaussians is 0", "1 to 67108864"});
  expect([](vtkBigusTrainer* f) { f->SetPrice(std::nan("")); }, {"price is nan", "0 to 100 dB"});
  expect([](vtkBigusTrainer* f) { f->SetInterpolation("sideways"); }, {"interpolation", "sideways", "+flow"});
  expect([](vtkBigusTrainer* f) { f->SetPreset("beauty"); }, {"preset", "beauty", "fidelity", "texture"});
  expect([](vtkBigusTrainer* f) { f->SetLoss("l1+l3"); }, {"loss", "l1+l3", "dssim"});
  expect([](vtkBigusTrainer* f) { f->SetLoss("-1*ffl"); }, {"loss", "ffl", "-1"});
  expect([](vtkBigusTrainer* f) { f->SetGaussians(vtkIdType(1) << 40); }, {"gaussians is 1099511627776", "67108864"});
  expect([](vtkBigusTrainer* f) { f->SetHoldOut(1); }, {"hold out is 1", "0 or 2"});
  expect([](vtkBigusTrainer* f) { f->SetOption("Batch", "many"); }, {"batch is many", "1 to 4096"});
  expect([](vtkBigusTrainer* f) { f->SetOption("Batch", "2.5"); }, {"batch is 2.5"});
  expect([](vtkBigusTrainer* f) { f->SetFrameGains(2); }, {"frame gains is '2'", "on|off"});
  expect([](vtkBigusTrainer* f) { f->SetEngine("abacus"); }, {"abacus"});
}

/// A number outside an option's range on either side.
TEST(TrainerBadInput, EveryOptionOutOfItsRangeIsOneErrorWithNameValueAndRange)
{
  int numbers = 0;
  for (const OptionText& option : ListOptions())
  {
    if (option.kind == OptionText::Kind::Number)
    {
      ++numbers;
      const double below = option.info.zeroIsNone ? 1 : option.info.least - 1, above = 2 * option.info.most;
      for (const double number : {below, above})
      {
        Quick quick;
        quick.trainer->SetOption(option.info.name, NumberText(number).c_str());
        ExpectOneError(quick.trainer,
                       {SpellOption(option.info.name) + " is " + NumberText(number) + ";", option.values});
      }
    }
  }
  EXPECT_GT(numbers, 15);
}

TEST(Trainer, AnOptionHasOneValueWhetherSetByItsPropertyOrByItsName)
{
  vtkNew<vtkBigusTrainer> trainer;
  EXPECT_EQ(trainer->GetNumberOfOptions(), static_cast<int>(ListOptions().size()));
  EXPECT_STREQ(trainer->GetOptionName(0), "Automatic");
  EXPECT_EQ(trainer->GetOptionName(-1), nullptr);
  EXPECT_TRUE(trainer->GetAutomatic());
  trainer->AutomaticOff();
  EXPECT_STREQ(trainer->GetOption("Automatic"), "off");
  EXPECT_EQ(trainer->GetVirtualPlanes(), -1);
  trainer->SetOption("VirtualPlanes", "2");
  EXPECT_EQ(trainer->GetVirtualPlanes(), 2);
  trainer->SetVirtualPlanes(-1);
  EXPECT_STREQ(trainer->GetOption("VirtualPlanes"), "auto");
  trainer->SetReflectivityRate(0.1);
  EXPECT_STREQ(trainer->GetOption("ReflectivityRate"), "0.1");
  EXPECT_EQ(trainer->GetReflectivityRate(), 0.1);
  trainer->SetLoss("l2");
  EXPECT_STREQ(trainer->GetLoss(), "l2");
  trainer->SetLoss(nullptr);
  EXPECT_STREQ(trainer->GetLoss(), "auto");
  const vtkMTimeType before = trainer->GetMTime();
  trainer->SetReflectivityRate(0.1);
  EXPECT_EQ(trainer->GetMTime(), before) << "nothing has changed";
  trainer->SetReflectivityRate(0.2);
  EXPECT_GT(trainer->GetMTime(), before);

  std::ostringstream printed;
  trainer->Print(printed);
  for (const OptionText& option : ListOptions())
  {
    EXPECT_NE(printed.str().find(std::string(option.info.name) + ": " + trainer->GetOption(option.info.name) + "\n"),
              std::string::npos)
        << option.info.name;
  }
  ErrorObserver errors(trainer);
  trainer->SetOption("Colour", "blue");
  ASSERT_EQ(errors.Errors().size(), 1u);
  EXPECT_NE(errors.Errors()[0].find("Colour"), std::string::npos);
}

TEST(Trainer, ANamedInterpolationKeepsContrastWhereThePresetAsksForIt)
{
  Quick open, named;
  for (Quick* quick : {&open, &named})
  {
    quick->trainer->SetPreset("texture");
    quick->trainer->SetIterations(5);
  }
  named.trainer->SetInterpolation("normals");  // what geometry chooses, too
  open.trainer->Update();
  named.trainer->Update();
  EXPECT_EQ(FieldFromPolyData(open.trainer->GetOutput()).means, FieldFromPolyData(named.trainer->GetOutput()).means);
}

TEST(Trainer, SeveralSweepsTrainOneField)
{
  Quick quick;
  const vtkSmartPointer<vtkImageData> second = PatternSweep();
  auto* poses = vtkDoubleArray::SafeDownCast(second->GetFieldData()->GetArray("ImageToReference"));
  vtkNew<vtkUnsignedCharArray> status;
  status->SetName("Status");
  for (int k = 0; k < 12; ++k)
  {
    poses->SetComponent(k, 3, poses->GetComponent(k, 3) + 40);  // 40 mm beside the first
    status->InsertNextValue(k != 3);
  }
  second->GetFieldData()->AddArray(status);
  quick.trainer->AddInputData(second);
  quick.trainer->SetGaussians(3000);
  quick.trainer->SetIterations(120);
  quick.trainer->Update();
  vtkPolyData* field = quick.trainer->GetOutput();
  ASSERT_GT(field->GetNumberOfPoints(), 2000);
  // Frame 2, 6 and 10 of the usable ones of either, counted on in the second.
  EXPECT_EQ(Values(quick.trainer->GetHeldOutFrames()), (std::vector<int>{2, 6, 10, 14, 19, 23}));
  EXPECT_EQ(quick.trainer->GetTrainingFrames()->GetNumberOfValues(), 9 + 8);
  EXPECT_GT(PsnrAt(field, quick.sweep, 6), 25);
  EXPECT_GT(PsnrAt(field, second, 7), 25);
  vtkDoubleArray* all = quick.trainer->GetCorrectedPoses();
  ASSERT_EQ(all->GetNumberOfTuples(), 24);
  for (int k = 0; k < 16; ++k)
  {
    EXPECT_EQ(all->GetComponent(5, k), quick.sweep->GetFieldData()->GetArray("ImageToReference")->GetComponent(5, k));
    EXPECT_EQ(all->GetComponent(17, k), poses->GetComponent(5, k));
  }
  EXPECT_EQ(GetProvenance(field, "sequences"), "2");
  EXPECT_EQ(GetProvenance(field, "poses.sequence2"), "as tracked");
}

TEST(TrainerBadInput, SeveralSweepsThatDoNotFit)
{
  {
    Quick quick;
    const vtkSmartPointer<vtkImageData> second = PatternSweep();
    second->GetFieldData()->RemoveArray("ImageToReference");
    quick.trainer->AddInputData(second);
    ExpectOneError(quick.trainer, {"Sequence 2", "ImageToReference"});
  }
  {
    Quick quick;
    const vtkSmartPointer<vtkImageData> second = PatternSweep();
    second->SetDimensions(40, 48, 12);  // as many pixels
    quick.trainer->AddInputData(second);
    ExpectOneError(quick.trainer, {"48 x 40", "40 x 48", "Crop or pad"});
  }
}

TEST(Trainer, SettledOptionsAreTold)
{
  Quick quick;
  EXPECT_STREQ(quick.trainer->GetSettledOption("Gaussians"), "");
  quick.trainer->SetIterations(2);
  quick.trainer->Update();
  EXPECT_STREQ(quick.trainer->GetSettledOption("Gaussians"), "1500");
  EXPECT_STREQ(quick.trainer->GetSettledOption("ElevationSigma"), "0");
  EXPECT_STREQ(quick.trainer->GetSettledOption("Interpolation"), "normals");
  EXPECT_STREQ(quick.trainer->GetSettledOption("Loss"), "l1");
}

TEST(TrainerBadInput, SweepsThatAreNone)
{
  {
    Quick quick;
    quick.sweep->GetFieldData()->RemoveArray("ImageToReference");
    ExpectOneError(quick.trainer, {"ImageToReference", "missing"});
  }
  {
    Quick quick;
    quick.sweep->GetFieldData()->GetArray("ImageToReference")->SetComponent(3, 5, std::nan(""));
    ExpectOneError(quick.trainer, {"frame 3"});
  }
  {
    Quick quick;  // singular
    quick.sweep->GetFieldData()->GetArray("ImageToReference")->Fill(0);
    ExpectOneError(quick.trainer, {"frame 0"});
  }
  {
    Quick quick;
    quick.sweep->AllocateScalars(VTK_INT, 1);
    ExpectOneError(quick.trainer, {"int", "unsigned char"});
  }
  {
    Quick quick;  // black from end to end
    quick.sweep->GetPointData()->GetScalars()->Fill(0);
    ExpectOneError(quick.trainer, {"black"});
  }
  {
    Quick quick;  // one frame
    quick.sweep->GetFieldData()->GetArray("ImageToReference")->Resize(1);
    quick.sweep->SetDimensions(48, 40, 1);
    quick.sweep->GetPointData()->GetScalars()->Resize(48 * 40);
    quick.trainer->SetHoldOut(0);
    ExpectOneError(quick.trainer, {"one frame"});
  }
  {
    vtkNew<vtkPolyData> wrong;
    vtkNew<vtkBigusTrainer> trainer;
    ErrorObserver quiet(trainer);
    trainer->SetInputData(wrong);
    trainer->Update();
    EXPECT_EQ(trainer->GetOutput()->GetNumberOfPoints(), 0);
  }
}

TEST(TrainerBadInput, FieldsThatCannotBeContinued)
{
  Quick quick;
  vtkNew<vtkPolyData> nothing;
  quick.trainer->SetInitialFieldData(nothing);
  ExpectOneError(quick.trainer, {"no Gaussian"});
  const auto field = ToPolyData(RandomField(10, 1));
  field->GetPointData()->GetArray("Scale")->SetComponent(2, 0, -1);
  quick.trainer->SetInitialFieldData(field);
  ExpectOneError(quick.trainer, {"Scale[2]"});
}

TEST(Trainer, PrintsWhatItIs)
{
  Quick quick;
  std::ostringstream text;
  quick.trainer->Print(text);
  for (const char* part : {"Gaussians: 1500", "Automatic: off", "Preset: fidelity", "Loss: auto", "FrameGains: off",
                           "Tolerance: 0.0001", "MaximumGaussians: auto", "IterationsDone: 0"})
  {
    EXPECT_NE(text.str().find(part), std::string::npos) << part;
  }
}

}  // namespace
}  // namespace bigus::test
