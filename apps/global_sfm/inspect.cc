#include <cstdio>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/database/report_bad_rows.h"
#include "cairn/io/model.h"
#include "cairn/mapper/view_edges.h"
#include "cairn/view_graph/view_graph_text.h"
#include "common/console_monitor.h"
#include "global_sfm/commands.h"
#include "global_sfm/describe.h"
#include "global_sfm/pairs_csv.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

struct InspectFlags {
  std::string database_path;
  std::string model_path;
  std::string model_list;
  std::string pairs_csv;
  std::string pairs_verifier;
  std::string graph_json;
  std::string graph_dot;
  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "database to look into");
    v.String("model_path", model_path,
             "model to look into: folder that reconstruct wrote (its largest model is taken), or a "
             "model of any format");
    v.String("model_list", model_list,
             "list of a Bundler model's images; default: list.txt beside it");
    v.String("pairs_csv", pairs_csv,
             "CSV file for every pair with matches: name1,name2,matches,inliers,iterations,ms, "
             "cam2_from_cam1 (qw,qx,qy,qz,tx,ty,tz; empty: unknown)");
    v.String("pairs_verifier", pairs_verifier,
             "the verifier whose results go to pairs_csv; default: the chosen results");
    v.String("graph_json", graph_json, "JSON file for the view graph");
    v.String("graph_dot", graph_dot, "Graphviz file for the view graph (draw: neato -Tsvg)");
  }
};

void InspectDatabase(const InspectFlags& flags, const ViewGraphBuilderOptions& options,
                     ProgressMonitor& monitor) {
  if (!flags.pairs_verifier.empty() && flags.pairs_csv.empty()) {
    throw ConfigError("--pairs_verifier", "needs --pairs_csv");
  }
  const Database database(flags.database_path, Database::Mode::kSnapshot);
  RunReport rows;
  ReportBadRows(database, rows, monitor);
  if (!flags.pairs_csv.empty()) {
    WriteFileAtomically(flags.pairs_csv,
                        FormatPairsCsv(ReadPairRows(database, flags.pairs_verifier)));
  }
  std::fputs(DescribeDatabase(database).c_str(), stdout);

  std::map<image_t, std::string> names;
  std::vector<image_t> image_ids;
  for (const Image& image : database.ReadImages()) {
    names[image.image_id] = image.name;
    image_ids.push_back(image.image_id);
  }
  std::vector<ViewEdge> edges =
      ReadViewEdges(database, [&](const std::string& m) { monitor.Warning(m); });
  const auto [graph, report] = BuildViewGraph(image_ids, std::move(edges), options);
  std::fputs(DescribeViewGraph(graph, report).c_str(), stdout);
  if (!flags.graph_json.empty()) {
    WriteFileAtomically(flags.graph_json, ViewGraphToJson(graph, names));
  }
  if (!flags.graph_dot.empty()) WriteFileAtomically(flags.graph_dot, ViewGraphToDot(graph, names));
}

int Run(const InspectFlags& flags, const ViewGraphBuilderOptions& options) {
  ConsoleMonitor monitor;
  if (flags.database_path.empty()) {
    if (flags.model_path.empty()) {
      throw ConfigError("--database_path", "or --model_path is required; see --help");
    }
    const std::pair<const char*, const std::string&> of_databases[] = {
        {"--pairs_csv", flags.pairs_csv},
        {"--pairs_verifier", flags.pairs_verifier},
        {"--graph_json", flags.graph_json},
        {"--graph_dot", flags.graph_dot}};
    for (const auto& [flag, value] : of_databases) {
      if (!value.empty()) throw ConfigError(flag, "needs --database_path");
    }
  } else {
    InspectDatabase(flags, options, monitor);
  }
  if (!flags.model_path.empty()) {
    WarnOfUnfinishedModels(flags.model_path, monitor);
    const Reconstruction model = ReadModel(flags.model_path, {.list_path = flags.model_list});
    std::fputs(DescribeModel(model).c_str(), stdout);
  }
  return kExitSuccess;
}

}  // namespace

void AddInspectCommand(Program& program) {
  Command& command =
      program.AddCommand("inspect", "Shows what is in a database or a model, at a glance.");
  const auto flags = std::make_shared<InspectFlags>();
  const auto options = std::make_shared<ViewGraphBuilderOptions>();
  command.AddOptions("", *flags);
  command.AddOptions("view_graph", *options);
  command.SetRun([flags, options] { return Run(*flags, *options); });
}

}  // namespace cairn
