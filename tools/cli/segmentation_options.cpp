// SPDX-License-Identifier: BSD-3-Clause
#include "segmentation_options.hpp"

#include <fmt/format.h>

#include <string>

#include "dynslam/runtime/error.hpp"
#include "validators.hpp"

namespace dynslam::app {

namespace rt = dynslam::runtime;

void add_segmentation_options(CLI::App& app, rt::SegmentationStageOptions& s) {
  app.add_option("--model", s.segmenter.model,
                 "Segmentation network, FILE.onnx: Mask R-CNN, YOLOv8/11-seg, DeepLab and the like");
  app.add_option_function<std::string>(
         "--engine", [&s](const std::string& name) { s.segmenter.engine = *rt::parse_engine(name); },
         "What runs the network: auto, onnxruntime, opencv")
      ->default_str("auto")
      ->check(CLI::IsMember({"auto", "onnxruntime", "opencv"}));
  app.add_option_function<std::string>(
         "--model-kind", [&s](const std::string& name) { s.segmenter.kind = *rt::parse_model_kind(name); },
         "What the network's outputs mean: auto, yolo, mask-rcnn, semantic")
      ->default_str("auto")
      ->check(CLI::IsMember({"auto", "yolo", "mask-rcnn", "semantic"}));
  app.add_option_function<std::string>(
         "--model-output",
         [&s](const std::string& name) { s.segmenter.output = *rt::parse_model_output(name); },
         "What the only channel of a semantic network holds: auto (by its values), labels, logits, "
         "probability, "
         "mask (0 to 255)")
      ->default_str("auto")
      ->check(CLI::IsMember({"auto", "labels", "logits", "probability", "mask"}));
  app.add_option("--model-output-name", s.segmenter.output_name,
                 "Output of the network that is the segmentation (default: by name and shape)");
  app.add_option("--dynamic-classes", s.segmenter.dynamic_classes, "Classes that move by themselves")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option(
         "--map-classes", s.segmenter.map_classes,
         "Classes that the map labels: any of the model, four beside chairs and displays (default: those)")
      ->delimiter(',');
  app.add_option("--min-score", s.segmenter.detection.min_score, "Score from which a detection counts")
      ->capture_default_str()
      ->check(number_in(0.0, 1.0));
  app.add_option("--network-threads", s.segmenter.threads, "Threads of the network, 1 to 64")
      ->capture_default_str()
      ->check(whole_in(1, 64));
  app.add_option_function<std::string>(
         "--segment-every", [&s](const std::string& text) { s.every = text == "auto" ? 0 : std::stoi(text); },
         "The network sees every so many frames, or (auto) ten a second; masks are carried between them")
      ->default_str("1")
      ->type_name("N|auto")
      ->check(auto_or(whole_in(1, 1000)));
  app.add_option_function<std::string>(
         "--segment", [&s](const std::string& how) { s.async = how == "async"; },
         "sync: before each frame is tracked; async: ahead, on a thread of its own (same results)")
      ->default_str("async")
      ->check(CLI::IsMember({"sync", "async"}));
  app.add_option("--keep-masks", s.keep, "Cut masks to the object's depth and carry missed ones forward")
      ->capture_default_str();
  app.add_option("--cache-masks", s.cache, "Folder that keeps the network's masks for the next run");
}

void add_mask_options(CLI::App& app, rt::RunOptions& o) {
  app.add_option(
      "--masks", o.masks,
      "Folder of a-priori masks, <time stamp>.png: masks, labels, instances, VOC palettes or alpha channels");
  app.add_option(
         "--mask-labels", o.mask_labels,
         "What their values mean: 15=person,9=chair, or one of voc, coco, cityscapes, instances, binary "
         "(default: by looking at them)")
      ->delimiter(',');
}

void check_used(const CLI::App& app, const rt::RunOptions& o) {
  const auto given = [&](const char* name) { return app.count(name) > 0; };
  const bool model = !o.segmentation.segmenter.model.empty();
  for (const char* name : {"--engine", "--model-kind", "--model-output", "--model-output-name", "--min-score",
                           "--network-threads", "--segment-every", "--segment", "--cache-masks"}) {
    if (!model && given(name))
      throw rt::UsageError(fmt::format("{} is of a network: give --model FILE.onnx, too", name));
  }
  for (const char* name : {"--dynamic-classes", "--map-classes", "--keep-masks"}) {
    if (!model && o.masks.empty() && given(name))
      throw rt::UsageError(fmt::format("{} is of a network or of masks: give --model or --masks, too", name));
  }
  if (o.masks.empty() && given("--mask-labels"))
    throw rt::UsageError("--mask-labels says what --masks holds: give --masks DIR, too");
}

}  // namespace dynslam::app
