// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "SpeedReport.h"

#include <sys/resource.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iomanip>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "Core/Engine/Engine.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Format.h"
#include "MachinePeak.h"
#include "Race.h"
#include "SlabReslice.h"
#include "TorchPass.h"
#include "Workloads.h"
#include "vtkImageData.h"

namespace bigus::bench
{

namespace
{

using Json = nlohmann::ordered_json;

Json ToJson(const Contender& c)
{
  return {{"name", c.name},
          {"threads", c.threads},
          {"ms", 1e3 * c.Seconds()},
          {"min_ms", 1e3 * c.Fastest()},
          {"max_ms", 1e3 * c.Slowest()},
          {"repeats", c.seconds.size()}};
}

std::string Threads(int threads)
{
  return std::to_string(threads) + (threads == 1 ? " thread" : " threads");
}

std::string Milliseconds(double seconds)
{
  return FormatNumber(1e3 * seconds, seconds < 0.01 ? 3 : 1);
}

/// "9.87e+09".
std::string Short(double value)
{
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(2);
  text << std::scientific << value;
  return text.str();
}

double Correlation(const float* a, const float* b, std::size_t count)
{
  const auto x = Eigen::Map<const Eigen::ArrayXf>(a, count).cast<double>();
  const auto y = Eigen::Map<const Eigen::ArrayXf>(b, count).cast<double>();
  const Eigen::ArrayXd dx = x - x.mean(), dy = y - y.mean();
  return (dx * dy).sum() / std::sqrt(dx.square().sum() * dy.square().sum());
}

std::vector<Contender*> Pointers(std::vector<Contender>& contenders)
{
  std::vector<Contender*> pointers;
  for (Contender& c : contenders)
  {
    pointers.push_back(&c);
  }
  return pointers;
}

Ratio Smaller(const std::optional<Ratio>& a, const Ratio& b)
{
  return a && a->value < b.value ? *a : b;
}

class Measurement
{
public:
  Measurement(command::Console& console, const SpeedOptions& options) : console_(console), options_(options)
  {
    for (const char* name : {"render_vs_plain", "render_vs_slab_reslice", "train_pass_vs_torch", "backward_vs_forward",
                             "field_2m_vs_140k", "second_core"})
    {
      ratios_[name] = nullptr;
      spread_[name] = nullptr;
    }
    threads_ = static_cast<int>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
    repeats_ = options.repeats > 0 ? options.repeats : (options.quick ? 3 : 9);
  }

  SpeedReport Run(Json& json)
  {
    engine_ = Engine::Create("cpu");
    machine_ = {{"device", engine_->Device()},
                {"processor", Processor()},
                {"threads", threads_},
                {"multiply_adds_per_second", nullptr},
                {"bytes_per_second", nullptr},
                {"multiply_adds_per_second_one_thread", nullptr},
                {"bytes_per_second_one_thread", nullptr}};
    console_.Print("Engine       " + engine_->Device() + "; " + Processor());
    console_.Print("Times are medians of " + std::to_string(repeats_) + " rounds (smallest to largest)" +
                   (options_.share < 1 ? "; fields hold a share of " + FormatNumber(options_.share, 3) +
                                             " of the Gaussians named: ratios do not count"
                                       : ""));
    if (Wants("machine"))
    {
      MeasureMachine();
    }
    if (Wants("evaluation"))
    {
      MeasureEvaluation();
    }
    if (Wants("render"))
    {
      MeasureRender();
    }
    if (Wants("train-pass"))
    {
      MeasureTrainPass();
    }
    if (Wants("frontier") || options_.frontier)
    {
      MeasureFrontier();
    }
    json = {{"ratios", ratios_},
            {"ratio_spread", spread_},
            {"splat_ns", splatNanoseconds_},
            {"pairs_per_second", pairsPerSecond_},
            {"frontier", frontier_},
            {"frontier_plain", frontierPlain_},
            {"machine", machine_},
            {"slices", slices_},
            {"timings", timings_},
            {"roofline", roofline_},
            {"memory", memory_},
            {"checks", checks_},
            {"repeats", repeats_},
            {"share", options_.share}};
    return report_;
  }

private:
  bool Wants(const std::string& workload) const
  {
    return options_.workloads.empty() || std::count(options_.workloads.begin(), options_.workloads.end(), workload);
  }

  std::size_t Gaussians(std::size_t count) const
  {
    return std::max<std::size_t>(static_cast<std::size_t>(options_.share * static_cast<double>(count)), 100);
  }

  static std::string Processor()
  {
    std::ifstream file("/proc/cpuinfo");
    std::string line;
    while (std::getline(file, line))
    {
      const std::size_t colon = line.find(": ");
      if (line.rfind("model name", 0) == 0 && colon != std::string::npos)
      {
        return line.substr(colon + 2);
      }
    }
    return "unknown processor";
  }

  void Check(const Json& entry) { checks_.push_back(entry); }

  /// Times them and writes the times down.
  void Race(const std::string& job, const std::vector<Contender*>& contenders, bool print = true)
  {
    bench::Race(contenders, repeats_, console_, job);
    for (const Contender* c : contenders)
    {
      timings_.push_back(ToJson(*c));
      if (print)
      {
        Row(c->name + ", " + Threads(c->threads), Milliseconds(c->Seconds()) + " (" + Milliseconds(c->Fastest()) +
                                                      " to " + Milliseconds(c->Slowest()) + ") ms");
      }
    }
  }

  void Row(const std::string& name, const std::string& value)
  {
    console_.Print("  " + name + std::string(name.size() < 58 ? 58 - name.size() : 1, ' ') + value);
  }

  void SetRatio(const std::string& name, const Ratio& ratio)
  {
    ratios_[name] = ratio.value;
    spread_[name] = {ratio.low, ratio.high};
    Row(name, FormatNumber(ratio.value, 2) + " x (" + FormatNumber(ratio.low, 2) + " to " +
                  FormatNumber(ratio.high, 2) + ")");
  }

  void MeasureMachine()
  {
    console_.Print("machine: what it can do at best");
    const MachinePeak one = MeasurePeak(1, repeats_), all = threads_ > 1 ? MeasurePeak(threads_, repeats_) : one;
    peak_ = one;
    machine_["multiply_adds_per_second"] = all.multiplyAddsPerSecond;
    machine_["bytes_per_second"] = all.bytesPerSecond;
    machine_["multiply_adds_per_second_one_thread"] = one.multiplyAddsPerSecond;
    machine_["bytes_per_second_one_thread"] = one.bytesPerSecond;
    Row("multiply-adds a second, 1 thread and all",
        Short(one.multiplyAddsPerSecond) + ", " + Short(all.multiplyAddsPerSecond));
    Row("bytes a second (triad), 1 thread and all", Short(one.bytesPerSecond) + ", " + Short(all.bytesPerSecond));
  }

  /// Speed of one thread beside the machine's. A pair costs three arithmetic instructions on as many lanes
  /// (two multiplications of the recurrence, one multiply-add into the pixel) and 8 bytes of pixel traffic,
  /// which stay in the cache if the engine works as meant: so more of the roof than 1 can be used in bytes,
  /// never in multiply-adds.
  void AddToRoofline(const std::string& name, double splats, double pairs, double seconds)
  {
    Json entry = {{"name", name},
                  {"splats_per_second", splats / seconds},
                  {"pairs_per_second", pairs / seconds},
                  {"share_of_multiply_adds", nullptr},
                  {"share_of_bytes", nullptr}};
    std::string shares;
    if (peak_)
    {
      const double arithmetic = 3 * pairs / seconds / peak_->multiplyAddsPerSecond;
      const double bytes = 8 * pairs / seconds / peak_->bytesPerSecond;
      entry["share_of_multiply_adds"] = arithmetic;
      entry["share_of_bytes"] = bytes;
      shares = "; " + FormatNumber(100 * arithmetic, 0) + " % of the peak multiply-adds";
    }
    roofline_.push_back(entry);
    Row("  " + name,
        FormatNumber(1e9 * seconds / splats, 1) + " ns a splat, " + Short(pairs / seconds) + " pairs/s" + shares);
  }

  void MeasureEvaluation()
  {
    console_.Print("evaluation: the kernel alone, 40000 splats, boxes of 3 sigma, 640 x 480 pixels, 1 thread");
    const std::vector<double> sigmas{1, 1.5, 2.5, 4};
    std::vector<std::unique_ptr<KernelRun>> runs;
    std::vector<Contender> contenders;
    for (double sigma : sigmas)
    {
      runs.push_back(std::make_unique<KernelRun>(sigma, Gaussians(40000)));
      contenders.push_back(
          {"evaluation, sigma " + FormatNumber(sigma, 1) + " px", 1, [run = runs.back().get()] { run->Run(); }, {}});
    }
    Race("Evaluating", Pointers(contenders));
    for (std::size_t i = 0; i < sigmas.size(); ++i)
    {
      const std::string key = FormatNumber(sigmas[i], sigmas[i] == std::floor(sigmas[i]) ? 0 : 1);
      const double seconds = contenders[i].Seconds();
      splatNanoseconds_[key] = 1e9 * seconds / static_cast<double>(runs[i]->Splats());
      pairsPerSecond_[key] = static_cast<double>(runs[i]->Pairs()) / seconds;
      AddToRoofline(contenders[i].name, static_cast<double>(runs[i]->Splats()), static_cast<double>(runs[i]->Pairs()),
                    seconds);
    }
  }

  /// The slices that the ratios are taken of: 140000 Gaussians, 512 x 512 pixels. Where voxels and pixels
  /// coincide vtkImageSlabReslice has a short cut, so the axial plane stands beside the oblique one, which is
  /// what poses are: the ratios are those of the oblique plane and of the footprint that makes them smaller.
  void MeasureHeadline()
  {
    console_.Print("render: 140000 Gaussians, 512 x 512, tolerance 1e-4, beside the plain loop and slab reslice");
    const int width = 512;
    std::optional<Ratio> plainRatio, slabRatio;
    // Seconds of all four slices, round by round.
    std::vector<double> one(repeats_, 0.0), two = one, controlOne = one, controlTwo = one;
    std::vector<float> image(width * width), plainImage;
    for (const FootprintSize& size : {kPixelSized, kFourPixels})
    {
      const MadeUpField description = FieldAround(width, Gaussians(140000), size);
      const GaussianField field = MakeField(description);
      const vtkSmartPointer<vtkImageData> volume = SampleField(field, description.box, console_);
      PlainRenderer plain(field);
      engine_->SetAccuracy({});
      engine_->SetField(field);
      for (bool oblique : {false, true})
      {
        const SlicePlane plane = MakePlane(width, oblique);
        const std::string name = std::string(size.name) + (oblique ? ", oblique" : ", axial");
        const auto reslice = NewSlabReslice(volume, plane, field.beam.elevationSigma);
        const auto render = [&] { engine_->Render(plane, ViewOutput::Intensity, image.data()); };
        Contender ours{"bigus, " + name, 1, render}, ours2{"bigus, " + name, 2, render};
        Contender loop{"plain loop, " + name, 1, [&] { plain.Render(plane, 1e-4, 1, plainImage); }};
        Contender loop2{"plain loop, " + name, 2, [&] { plain.Render(plane, 1e-4, 2, plainImage); }};
        Contender slab{"vtkImageSlabReslice, " + name, 1,
                       [&]
                       {
                         reslice->Modified();
                         reslice->Update();
                       }};
        std::vector<Contender*> contenders{&ours, &loop, &slab};
        if (threads_ > 1)
        {
          contenders.push_back(&ours2);
          contenders.push_back(&loop2);
        }
        Race("Rendering", contenders);
        const Ratio overPlain = Over(loop, ours), overSlab = Over(slab, ours);
        slices_.push_back(
            {{"name", name}, {"render_vs_plain", overPlain.value}, {"render_vs_slab_reslice", overSlab.value}});
        Row("  against plain loop, slab reslice",
            FormatNumber(overPlain.value, 2) + " x, " + FormatNumber(overSlab.value, 2) + " x");
        if (oblique)
        {
          plainRatio = Smaller(plainRatio, overPlain);
          slabRatio = Smaller(slabRatio, overSlab);
        }
        for (int round = 0; threads_ > 1 && round < repeats_; ++round)
        {
          one[round] += ours.seconds[round];
          two[round] += ours2.seconds[round];
          controlOne[round] += loop.seconds[round];
          controlTwo[round] += loop2.seconds[round];
        }
        // One thread's counts: boxes of the same cut as the engine's.
        plain.Render(plane, 1e-4, 1, plainImage);
        AddToRoofline(ours.name, static_cast<double>(plain.Splats()), static_cast<double>(plain.Pairs()),
                      ours.Seconds());

        // All three must show the same picture.
        float largest = 0;
        for (std::size_t i = 0; i < image.size(); ++i)
        {
          largest = std::max(largest, std::abs(image[i] - plainImage[i]));
        }
        engine_->Render(plane, ViewOutput::Scattering, image.data());
        const auto* slabImage = static_cast<const float*>(reslice->GetOutput()->GetScalarPointer());
        const double alike = Correlation(image.data(), slabImage, image.size());
        Check({{"name", "bigus and plain loop, " + name}, {"largest_difference", largest}});
        Check({{"name", "bigus and slab reslice, " + name},
               {"correlation", alike},
               {"samples", reslice->GetNumBlendSamplePoints()}});
        Row("  same picture",
            "plain loop within " + Short(largest) + ", slab reslice correlates " + FormatNumber(alike, 4));
        if (!(largest < 1e-3f) || !(alike > 0.9) || reslice->GetNumBlendSamplePoints() != 9)
        {
          throw Error("The pictures compared (" + name + ") do not show the same thing: the plain loop differs by " +
                      Short(largest) + ", slab reslice correlates " + FormatNumber(alike, 4) + " with " +
                      std::to_string(reslice->GetNumBlendSamplePoints()) + " samples.");
        }
      }
      if (!memory_.contains("rendering_bytes_per_gaussian"))
      {
        memory_["rendering_bytes_per_gaussian"] =
            static_cast<double>(engine_->MemoryUse()) / static_cast<double>(field.Size());
      }
    }
    SetRatio("render_vs_plain", *plainRatio);
    SetRatio("render_vs_slab_reslice", *slabRatio);
    if (threads_ > 1)
    {
      renderSecondCore_ = Over(one, two);
      const Ratio control = Over(controlOne, controlTwo);
      machine_["second_core_control"] = control.value;
      machine_["second_core_control_spread"] = {control.low, control.high};
      SetRatio("second_core", *renderSecondCore_);
      Row("second core, plain two-thread control", FormatNumber(control.value, 2) + " x (" +
                                                       FormatNumber(control.low, 2) + " to " +
                                                       FormatNumber(control.high, 2) + ")");
    }
  }

  void MeasureLargeField()
  {
    console_.Print("render: 2000000 Gaussians against 140000 at the same density, so that a plane sees as many");
    std::optional<Ratio> worst;
    const std::size_t small = Gaussians(140000), large = Gaussians(2000000);
    std::vector<float> image(512 * 512);
    for (const FootprintSize& size : {kPixelSized, kFourPixels})
    {
      const MadeUpField description = FieldAround(512, small, size);
      const GaussianField field = MakeField(description), grown = MakeField(Grown(description, large));
      const auto other = Engine::Create("cpu");
      engine_->SetAccuracy({});
      engine_->SetField(field);
      other->SetField(grown);
      PlainRenderer plain(field), plainGrown(grown);
      for (bool oblique : {false, true})
      {
        const SlicePlane plane = MakePlane(512, oblique);
        const std::string name = std::string(size.name) + (oblique ? ", oblique" : ", axial");
        Contender few{"140k, " + name, 1, [&] { engine_->Render(plane, ViewOutput::Intensity, image.data()); }};
        Contender many{"2M, " + name, 1, [&] { other->Render(plane, ViewOutput::Intensity, image.data()); }};
        Race("Rendering", {&few, &many});
        std::vector<float> unused;
        plain.Render(plane, 1e-4, 1, unused);
        plainGrown.Render(plane, 1e-4, 1, unused);
        Check({{"name", "visible splats, " + name},
               {"gaussians_140k", plain.Splats()},
               {"gaussians_2m", plainGrown.Splats()}});
        Row("  visible splats", std::to_string(plain.Splats()) + " and " + std::to_string(plainGrown.Splats()));
        const Ratio ratio = Over(many, few);
        worst = worst && worst->value > ratio.value ? *worst : ratio;
      }
    }
    SetRatio("field_2m_vs_140k", *worst);
  }

  /// What every size costs, and the reference engine for scale.
  void MeasureSizes()
  {
    console_.Print("render: sizes of fields and slices (visible splats in brackets)");
    const std::vector<std::size_t> counts = options_.quick ? std::vector<std::size_t>{10000, 140000}
                                                           : std::vector<std::size_t>{10000, 140000, 1000000, 2000000};
    for (int width : {160, 512})
    {
      for (const FootprintSize& size : {kPixelSized, kFourPixels})
      {
        for (std::size_t count : counts)
        {
          const GaussianField field = MakeField(FieldAround(width, Gaussians(count), size));
          const SlicePlane plane = MakePlane(width, true);
          std::vector<float> image(plane.NumberOfPixels()), plainImage;
          PlainRenderer plain(field);
          plain.Render(plane, 1e-4, 1, plainImage);
          engine_->SetAccuracy({});
          engine_->SetField(field);
          const auto render = [&] { engine_->Render(plane, ViewOutput::Intensity, image.data()); };
          const std::string name = std::to_string(width) + " x " + std::to_string(width) + ", " +
                                   std::to_string(field.Size()) + " " + size.name + " [" +
                                   std::to_string(plain.Splats()) + "]";
          Contender one{name, 1, render}, all{name, threads_, render};
          std::vector<Contender*> contenders{&one};
          if (threads_ > 1)
          {
            contenders.push_back(&all);
          }
          Race("Rendering", contenders);
          if (width == 160 && count == 10000 && size.smallest == kPixelSized.smallest)
          {
            MeasureReference(field, plane, one);
          }
        }
      }
    }
  }

  void MeasureReference(const GaussianField& field, const SlicePlane& plane, const Contender& ours)
  {
    const int rows = 8;
    const auto reference = Engine::Create("reference");
    reference->SetField(field);
    std::vector<float> image(std::size_t(plane.width) * rows);
    Contender slow{"reference engine, " + std::to_string(rows) + " of " + std::to_string(plane.height) +
                       " rows of the slice above",
                   1, [&] {
                     reference->Render(plane, {0, plane.height / 2, plane.width, rows}, ViewOutput::Intensity,
                                       image.data(), nullptr);
                   }};
    Race("Rendering", {&slow});
    Row("  render_vs_reference, for all rows",
        FormatNumber(slow.Seconds() * plane.height / rows / ours.Seconds(), 0) + " x");
  }

  void MeasureRender()
  {
    MeasureHeadline();
    MeasureLargeField();
    MeasureSizes();
  }

  static std::unique_ptr<Engine> NewTrainingEngine(const TrainingPass& pass)
  {
    auto engine = Engine::Create("cpu");
    engine->SetFrames(pass.sweep);
    engine->SetAccuracy(pass.accuracy);
    engine->SetField(pass.field);
    return engine;
  }

  void MeasureTrainPass()
  {
    const int frames = options_.quick ? 32 : 160, width = 160, batch = 8;
    const std::size_t count = Gaussians(140000);
    console_.Print("train-pass: " + std::to_string(count) + " Gaussians, " + std::to_string(frames) +
                   " slices of 160 x 160 in batches of 8");
    const TrainingPass pass = MakeTrainingPass(count, frames, width, batch);
    const auto engine = NewTrainingEngine(pass);
    const std::size_t idle = engine->MemoryUse();
    // A pass starts from the same field each time, with whatever the engine prepares on first use in place.
    std::vector<float> image(pass.sweep->PixelsPerFrame());
    const auto reset = [&]
    {
      engine->SetField(pass.field);
      engine->Render(pass.sweep->Plane(0), ViewOutput::Intensity, image.data());
    };
    std::vector<double> losses(pass.batches.size());
    const auto train = [&]
    {
      for (std::size_t b = 0; b < pass.batches.size(); ++b)
      {
        losses[b] = engine->TrainStep(pass.batches[b], Loss(), pass.rates, pass.limits);
      }
    };
    std::vector<SlicePlane> planes;
    for (int frame = 0; frame < frames; ++frame)
    {
      planes.push_back(pass.sweep->Plane(frame));
    }
    // Forward and backward without a step: another engine, whose field stays as it was.
    const auto untrained = NewTrainingEngine(pass);
    Contender one{"train-pass", 1, train, reset}, two{"train-pass", 2, train, reset},
        all{"train-pass", threads_, train, reset};
    Contender forward{"forward: the same frames rendered", 1,
                      [&]
                      {
                        for (const SlicePlane& plane : planes)
                        {
                          untrained->Render(plane, ViewOutput::Intensity, image.data());
                        }
                      }};
    Contender both{"forward and backward: gradient of every batch", 1,
                   [&]
                   {
                     for (const std::vector<int>& frameNumbers : pass.batches)
                     {
                       untrained->Backpropagate(frameNumbers, Loss());
                     }
                   }};
    std::vector<Contender*> contenders{&one, &forward, &both};
    if (threads_ > 1)
    {
      contenders.push_back(&two);
    }
    if (threads_ > 2)
    {
      contenders.push_back(&all);
    }
    Race("Training", contenders);

    std::vector<double> backward;
    for (std::size_t round = 0; round < both.seconds.size(); ++round)
    {
      backward.push_back(both.seconds[round] - forward.seconds[round]);
    }
    SetRatio("backward_vs_forward", Over(backward, forward.seconds));
    if (threads_ > 1)
    {
      // Of rendering and training the one that gains less.
      SetRatio("second_core", Smaller(renderSecondCore_, Over(one, two)));
    }

    // Memory: after a pass, and what another frame in a batch adds.
    engine->SetField(pass.field);
    train();
    const std::size_t trained = engine->MemoryUse();
    std::vector<int> half(pass.batches[0].begin(), pass.batches[0].begin() + batch / 2);
    const auto fresh = NewTrainingEngine(pass);
    fresh->TrainStep(half, Loss(), pass.rates, pass.limits);
    const std::size_t withHalf = fresh->MemoryUse();
    fresh->TrainStep(pass.batches[0], Loss(), pass.rates, pass.limits);
    const double perFrame =
        (static_cast<double>(fresh->MemoryUse()) - static_cast<double>(withHalf)) / (batch - batch / 2);
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    memory_["field_bytes_per_gaussian"] = static_cast<double>(idle) / static_cast<double>(count);
    memory_["training_bytes_per_gaussian"] = static_cast<double>(trained) / static_cast<double>(count);
    memory_["bytes_per_frame_stored"] = pass.sweep->PixelsPerFrame();
    memory_["working_bytes_per_frame_of_a_batch"] = perFrame;
    memory_["peak_resident_bytes_of_process"] = static_cast<double>(usage.ru_maxrss) * 1024;
    Row("memory of the engine after the pass",
        FormatNumber(static_cast<double>(trained) / static_cast<double>(count), 0) + " bytes a Gaussian, all in all");
    Row("memory a frame", std::to_string(pass.sweep->PixelsPerFrame()) + " bytes stored, " + FormatNumber(perFrame, 0) +
                              " more while it is in a batch");

    std::vector<const Contender*> passes{&one};
    if (threads_ > 1)
    {
      passes.push_back(contenders.back());
    }
    CompareWithTorch(pass, losses.front(), passes);
  }

  /// With one thread each and with all: the smaller ratio counts.
  void CompareWithTorch(const TrainingPass& pass, double firstLoss, const std::vector<const Contender*>& passes)
  {
    std::optional<Ratio> least;
    for (const Contender* ours : passes)
    {
      console_.Progress("Training in PyTorch", 0);
      const TorchResult torch = RunTorchPass(pass, options_.quick ? 1 : std::min(repeats_, 3), ours->threads);
      console_.EndProgress();
      if (!torch.missing.empty())
      {
        console_.Note("train_pass_vs_torch skipped: " + torch.missing + ".");
        Check({{"name", "torch"}, {"skipped", torch.missing}});
        return;
      }
      Contender theirs{"train-pass in PyTorch " + torch.version, ours->threads, {}};
      theirs.seconds = torch.seconds;
      timings_.push_back(ToJson(theirs));
      Row(theirs.name + ", " + Threads(theirs.threads), Milliseconds(theirs.Seconds()) + " ms");
      Row("  loss of the first batch: bigus, PyTorch",
          FormatNumber(firstLoss, 7) + ", " + FormatNumber(torch.losses.front(), 7));
      Check({{"name", "torch, " + Threads(ours->threads)},
             {"first_loss", firstLoss},
             {"first_loss_torch", torch.losses.front()}});
      if (!(std::abs(firstLoss - torch.losses.front()) < 1e-3 * firstLoss))
      {
        throw Error("PyTorch's loss of the first batch, " + FormatNumber(torch.losses.front(), 7) + ", is not ours, " +
                    FormatNumber(firstLoss, 7) + ": the two passes are not the same.");
      }
      // Their rounds are not ours: the spread is that of any round over any other.
      least = Smaller(least, {theirs.Seconds() / ours->Seconds(), theirs.Fastest() / ours->Slowest(),
                              theirs.Slowest() / ours->Fastest()});
    }
    SetRatio("train_pass_vs_torch", *least);
  }

  void MeasureFrontier()
  {
    const int width = 512;
    const GaussianField field = MakeField(FieldAround(width, Gaussians(140000), kFourPixels));
    const SlicePlane plane = MakePlane(width, true);
    const std::vector<std::size_t> pixels = SamplePixels(plane, options_.quick ? 1024 : 8192, 6);
    console_.Print("frontier: speed against error, " + std::to_string(field.Size()) +
                   " Gaussians of 4 pixels, 512 x 512 oblique; |dI| against the untruncated double reference at " +
                   std::to_string(pixels.size()) + " random pixels");
    const std::vector<double> reference = ReferenceIntensities(field, plane, pixels);
    CheckReference(field, plane, pixels, reference);

    struct Setting
    {
      double tolerance;
      std::string precision, evaluation;
      Contender contender;
      ErrorStatistics error;
    };
    std::vector<Setting> settings;
    const std::vector<double> tolerances{1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
    const std::vector<int> threads = threads_ > 1 ? std::vector<int>{1, threads_} : std::vector<int>{1};
    const auto add = [&](double tolerance, const std::string& precision, const std::string& evaluation, int t,
                         const std::vector<float>& image, std::function<void()> run, std::function<void()> prepare)
    {
      settings.push_back({tolerance, precision, evaluation,
                          Contender{"frontier, " + precision + ", " + evaluation + ", " + Short(tolerance), t,
                                    std::move(run), std::move(prepare)},
                          CompareWith(reference, pixels, image)});
    };

    std::vector<std::unique_ptr<Engine>> engines;
    std::vector<float> image(plane.NumberOfPixels());
    const std::vector<std::string> names = Engine::Names();
    for (const auto& [precision, name] :
         {std::pair<std::string, std::string>{"float", "cpu"}, {"double", "cpu-double"}})
    {
      if (!std::count(names.begin(), names.end(), name))
      {
        console_.Note("frontier: there is no engine '" + name + "' here; " + precision + " is left out.");
        continue;
      }
      engines.push_back(Engine::Create(name));
      Engine* const engine = engines.back().get();
      engine->SetField(field);
      const auto render = [engine, &plane, &image] { engine->Render(plane, ViewOutput::Intensity, image.data()); };
      for (bool direct : {false, true})
      {
        for (double tolerance : tolerances)
        {
          const auto prepare = [engine, tolerance, direct] { engine->SetAccuracy({tolerance, false, direct}); };
          std::vector<float> first;
          for (int t : threads)
          {
            const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, t);
            prepare();
            render();
            if (!first.empty() && first != image)
            {
              throw Error("The picture depends on the number of threads (" + precision + ", tolerance " +
                          Short(tolerance) + ").");
            }
            first = image;
            add(tolerance, precision, direct ? "direct" : "recurrence", t, image, render, prepare);
          }
        }
      }
    }
    PlainRenderer plain(field);
    for (double tolerance : tolerances)
    {
      const auto render = [&plain, &plane, &image, tolerance] { plain.Render(plane, tolerance, 1, image); };
      render();
      add(tolerance, "float", "plain loop", 1, image, render, {});
    }
    std::vector<Contender*> contenders;
    for (Setting& setting : settings)
    {
      contenders.push_back(&setting.contender);
    }
    Race("Rendering", contenders, false);

    std::ostringstream table;
    table.imbue(std::locale::classic());
    table << "tolerance,precision,evaluation,threads,ms,min_ms,max_ms,max,rms,p999\n";
    console_.Print("  tolerance  precision  evaluation  threads        ms       max       rms      p999");
    for (const Setting& s : settings)
    {
      const Contender& c = s.contender;
      Json row = {{"tolerance", s.tolerance}, {"precision", s.precision}, {"evaluation", s.evaluation},
                  {"threads", c.threads},     {"ms", 1e3 * c.Seconds()},  {"max", s.error.max},
                  {"rms", s.error.rms},       {"p999", s.error.p999}};
      (s.evaluation == "plain loop" ? frontierPlain_ : frontier_).push_back(std::move(row));
      table << s.tolerance << ',' << s.precision << ',' << s.evaluation << ',' << c.threads << ',' << 1e3 * c.Seconds()
            << ',' << 1e3 * c.Fastest() << ',' << 1e3 * c.Slowest() << ',' << s.error.max << ',' << s.error.rms << ','
            << s.error.p999 << '\n';
      std::ostringstream line;
      line.imbue(std::locale::classic());
      line << "  " << std::left << std::setw(11) << Short(s.tolerance) << std::setw(11) << s.precision << std::setw(12)
           << s.evaluation << std::right << std::setw(7) << c.threads << std::setw(10)
           << FormatNumber(1e3 * c.Seconds(), 2) << std::setw(10) << Short(s.error.max) << std::setw(10)
           << Short(s.error.rms) << std::setw(10) << Short(s.error.p999);
      console_.Print(line.str());
    }
    report_.frontierCsv = table.str();
  }

  /// The errors' reference must be what the reference engine says; asked at a few of the pixels.
  void CheckReference(const GaussianField& field, const SlicePlane& plane, const std::vector<std::size_t>& pixels,
                      const std::vector<double>& reference)
  {
    const auto engine = Engine::Create("reference");
    engine->SetField(field);
    double largest = 0;
    for (std::size_t p = 0; p < std::min<std::size_t>(pixels.size(), 4); ++p)
    {
      float value = 0;
      engine->Render(plane, {int(pixels[p] % plane.width), int(pixels[p] / plane.width), 1, 1}, ViewOutput::Intensity,
                     &value, nullptr);
      largest = std::max(largest, std::abs(value - reference[p]));
    }
    Check({{"name", "double reference and reference engine"}, {"largest_difference", largest}});
    if (!(largest < 1e-6))
    {
      throw Error("The double reference differs from the reference engine by " + Short(largest) + ".");
    }
  }

  command::Console& console_;
  const SpeedOptions& options_;
  int threads_, repeats_;
  SpeedReport report_;
  std::unique_ptr<Engine> engine_;
  std::optional<MachinePeak> peak_;
  std::optional<Ratio> renderSecondCore_;
  Json ratios_, spread_, machine_;
  Json splatNanoseconds_ = Json::object(), pairsPerSecond_ = Json::object(), memory_ = Json::object();
  Json frontier_ = Json::array(), frontierPlain_ = Json::array(), slices_ = Json::array(), timings_ = Json::array(),
       roofline_ = Json::array(), checks_ = Json::array();
};

}  // namespace

SpeedReport MeasureSpeed(const SpeedOptions& options, command::Console& console, Json& json)
{
  return Measurement(console, options).Run(json);
}

}  // namespace bigus::bench
