#include "global_sfm/run_folder.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/csv.h"
#include "cairn/io/model.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

bool IsRunFolder(const fs::path& folder) {
  return fs::exists(folder / "report.json") && fs::exists(folder / "effective.toml");
}

Json ReadJson(const std::string& path) {
  // What lies deeper would be copied by recursion.
  const auto keeps = [](int depth, Json::parse_event_t, const Json&) { return depth < 32; };
  try {
    return Json::parse(ReadFile(path), keeps);
  } catch (const Json::exception& error) {
    throw IoError(path, error.what());
  }
}

// A number, or null where it was not finite.
double NumberOf(const Json& value) { return value.is_number() ? value.get<double>() : 0.0; }

int64_t IntegerOf(const Json& value) {
  if (value.is_number_integer()) return value.get<int64_t>();
  throw Json::type_error::create(302, "a whole number is expected, not " + value.dump(), &value);
}

// Throws where an edge cannot be one of a view graph, or is there twice.
void CheckEdges(const ViewGraph& graph, const std::string& path) {
  const std::set<image_t> images(graph.image_ids.begin(), graph.image_ids.end());
  std::set<image_pair_t> pairs;
  for (const ViewEdge& edge : graph.edges) {
    const image_t id1 = edge.image_id1, id2 = edge.image_id2;
    const bool has_images = id1 < id2 && images.contains(id1) && images.contains(id2);
    if (has_images && pairs.insert(edge.PairId()).second) continue;
    throw IoError(path, "an edge of images " + std::to_string(id1) + " and " + std::to_string(id2) +
                            (has_images ? " is there twice" : " cannot be"));
  }
}

// Reads what ViewGraphToJson wrote.
ViewGraph ReadViewGraph(const std::string& path) {
  const Json json = ReadJson(path);
  ViewGraph graph;
  try {
    for (const Json& image : json.at("images"))
      graph.image_ids.push_back(static_cast<image_t>(IntegerOf(image.at("id"))));
    for (const Json& item : json.at("edges")) {
      ViewEdge& edge = graph.edges.emplace_back();
      edge.image_id1 = static_cast<image_t>(IntegerOf(item.at("image_id1")));
      edge.image_id2 = static_cast<image_t>(IntegerOf(item.at("image_id2")));
      edge.num_inliers = static_cast<int>(IntegerOf(item.at("num_inliers")));
      edge.residual_px = NumberOf(item.at("residual_px"));
      edge.triangulation_angle_deg = NumberOf(item.at("triangulation_angle_deg"));
      edge.verifier = item.at("verifier").get<std::string>();
      edge.removal = ValueOf(kEdgeRemovals, item.at("status").get<std::string>())
                         .value_or(EdgeRemoval::kOtherComponent);  // of another version: not in use
    }
  } catch (const Json::exception& error) {
    throw IoError(path, error.what());
  }
  CheckEdges(graph, path);
  graph.Normalize();
  return graph;
}

// How many models the report says that there are.
int NumModels(const std::string& report_path) {
  const Json report = ReadJson(report_path);
  try {
    const bool has_models = report.value("succeeded", false) && report.contains("values");
    return has_models ? static_cast<int>(IntegerOf(report["values"].value("models", Json(0)))) : 0;
  } catch (const Json::exception& error) {
    throw IoError(report_path, error.what());
  }
}

// A line for each image of each model, in their order.
std::vector<std::map<image_t, PoseConfidence>> ReadConfidences(
    const std::string& path, const std::vector<Reconstruction>& models) {
  TextReader reader(path);
  reader.NextLine();  // what the columns are
  std::vector<std::map<image_t, PoseConfidence>> confidences(models.size());
  for (size_t k = 0; k < models.size(); ++k) {
    for (const auto& [id, image] : models[k].images) {
      const std::string name = CsvField(image.image.name) + ",";
      const bool is_there = reader.NextLine() && reader.line().starts_with(name);
      // model, pairs, points, and two standard deviations, which may be infinite
      const auto fields = is_there ? Split(reader.line().substr(name.size()), ',')
                                   : std::vector<std::string_view>();
      if (fields.size() != 5) reader.Fail("the line of " + image.image.name + " is not here");
      const auto value = [&](size_t at) {
        return TextReader::ToDouble(fields[at]).value_or(std::numeric_limits<double>::infinity());
      };
      confidences[k][id] = {static_cast<int>(std::clamp(value(2), 0.0, 1e9)), value(3), value(4)};
    }
  }
  return confidences;
}

}  // namespace

std::string RunFolderOf(const std::string& path) {
  fs::path folder = fs::absolute(path).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  if (IsRunFolder(folder)) return folder.string();
  const fs::path models = folder.filename() == "sparse" ? folder : folder.parent_path();
  const bool is_of_run = models.filename() == "sparse" && IsRunFolder(models.parent_path());
  return is_of_run ? models.parent_path().string() : "";
}

void WarnOfUnfinishedModels(const std::string& model_path, ProgressMonitor& monitor) {
  const bool is_file = fs::is_regular_file(model_path);  // bundle.out
  const std::string folder =
      RunFolderOf(is_file ? fs::absolute(model_path).parent_path().string() : model_path);
  if (folder.empty()) return;
  const Json report = Json::parse(ReadFile(folder + "/report.json"), nullptr, false);
  if (!report.is_object() || report.value("succeeded", Json()) != Json(false)) return;
  monitor.Warning(folder + ": its models are unfinished, as report.json says; reconstruct again");
}

void WarnOfOtherModels(const std::string& model_path, const std::string& done,
                       ProgressMonitor& monitor) {
  const std::vector<std::string> paths = ModelsIn(model_path);
  for (const std::string& path : std::span(paths).subspan(1)) {
    std::string photos;
    try {
      const size_t num = ReadModel(path, {.read_points = false}).images.size();
      photos = " with " + std::to_string(num) + " more photographs";
    } catch (const IoError&) {  // who wants it will hear why
    }
    monitor.Warning(path + photos + " is not " + done +
                    ": give it as --model_path, with another --output_path");
  }
}

RunFolder ReadRunFolder(const std::string& folder) {
  RunFolder run;
  run.report_json = ReadFile(folder + "/report.json");
  const int num_models = NumModels(folder + "/report.json");
  for (int k = 0; k < num_models; ++k) {
    run.model_names.push_back("sparse/" + std::to_string(k));
    run.models.push_back(ReadModel(folder + "/" + run.model_names.back()));
  }
  if (num_models > 0) {
    run.confidences = ReadConfidences(folder + "/confidence.csv", run.models);
  }
  run.graph = ReadViewGraph(folder + "/view_graph.json");
  return run;
}

}  // namespace cairn
