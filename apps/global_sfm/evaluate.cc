#include <cstdio>

#include "cairn/base/file.h"
#include "cairn/evaluation/pose_evaluation.h"
#include "cairn/io/model.h"
#include "common/console_monitor.h"
#include "global_sfm/commands.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

struct EvaluateFlags {
  std::string model_path;
  std::string model_list;
  std::string reference_path;
  std::string reference_list;
  std::string output_path;
  void VisitFields(OptionVisitor& v) {
    v.String(
        "model_path", model_path,
        "what is evaluated: folder that reconstruct wrote (its largest model is taken), COLMAP "
        "model folder or Bundler file");
    v.String("model_list", model_list,
             "list of a Bundler model's images; default: list.txt beside it");
    v.String("reference_path", reference_path,
             "the truth: COLMAP model folder, folder of Strecha .camera files, or Bundler file "
             "(1DSfM: gt_bundle.out)");
    v.String("reference_list", reference_list,
             "list of a Bundler reference's images; default: list.txt beside it");
    v.String("output_path", output_path, "JSON file for all figures; default: none is written");
  }
};

PosedCameras ReadPoses(const std::string& path, const std::string& list_path) {
  return PosedCamerasOf(ReadModel(path, {.list_path = list_path, .read_points = false}));
}

int Run(Command&, EvaluateFlags& flags) {
  ConsoleMonitor monitor;
  WarnOfUnfinishedModels(flags.model_path, monitor);
  const PosedCameras estimate = ReadPoses(flags.model_path, flags.model_list);
  const PosedCameras reference = ReadPoses(flags.reference_path, flags.reference_list);
  const PoseEvaluation evaluation = EvaluatePoses(estimate, reference);
  std::fputs(FormatPoseEvaluation(evaluation).c_str(), stdout);
  if (!flags.output_path.empty()) {
    WriteFileAtomically(flags.output_path, PoseEvaluationToJson(evaluation));
  }
  if (evaluation.num_registered > 0) return kExitSuccess;
  monitor.Warning("no image of the reference (such as '" +
                  (reference.empty() ? std::string() : reference.begin()->first) +
                  "') is in the model (such as '" +
                  (estimate.empty() ? std::string() : estimate.begin()->first) + "')");
  return kExitNoUsableResult;
}

}  // namespace

void AddEvaluateCommand(Program& program) {
  AddCommand<EvaluateFlags>(program, "evaluate",
                            "Compares a model's camera poses with a reference.",
                            {"model_path", "reference_path"}, Run);
}

}  // namespace cairn
