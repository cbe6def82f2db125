#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "bundle_adjustment/keypoint_noise.h"
#include "cairn/base/run_context.h"
#include "cairn/georegistration/georegister.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/scene/view_graph.h"
#include "cairn/triangulation/triangulation.h"
#include "evaluation/model_evidence.h"
#include "report/stage.h"

namespace cairn {

// What a scene leaves open: its cameras, which images share one, and the poses of pairs by that.
struct Calibration {
  std::map<camera_t, Camera> cameras;
  std::map<image_t, Image> images;
  std::vector<ViewEdge> edges;
  std::map<image_t, camera_t> stored_cameras;  // of images that share one by ShareCamera
  std::map<camera_t, CalibratedFocal> focals_by_pairs;
  std::map<camera_t, double> held_focals;    // standard deviations, as logarithms (HoldExif)
  std::map<camera_t, Camera> before_models;  // cameras of finished models, before (TakeIntrinsics)
  std::string origin;                        // in words

  // By what is known without models.
  const Camera& KnownCamera(camera_t id) const {
    const auto before = before_models.find(id);
    return before != before_models.end() ? before->second : cameras.at(id);
  }
};

// What holds for all images of a database.
struct SceneFacts {
  // Of the database, from any thread. All matches of a pair, as in SceneData::matches, but before
  // verification; none where there are none (empty: there are none at all). What verification
  // found.
  std::function<FeatureMatches(const ViewEdge&)> raw_matches;
  std::function<TwoViewGeometry(image_pair_t)> stored_geometry;
  // The pairs that were matched, with or without success; likewise.
  std::function<std::vector<image_pair_t>()> tried_pairs;
  // The relative poses are those of a 1DSfM data set, without counted inliers; without tracks, it
  // has no matches either, and the models have no points.
  bool poses_imported = false;
  bool poses_alone = false;
  std::shared_ptr<const KnownPositions> places;  // nullptr: none are to be used
  std::optional<ResultWarning> still_parts;      // see FindStillParts
};

// What the database holds, ready for the stages.
struct SceneData : Calibration, SceneFacts {
  std::map<image_t, std::vector<Eigen::Vector2d>> pixels;  // of the keypoints
  KeypointScales scales;
  // Geometries, without matches, of the pairs that another program verified.
  std::map<image_pair_t, TwoViewGeometry> foreign;
  // Inlier matches of the edges; keypoints at one position are replaced by the first of them.
  std::map<image_pair_t, FeatureMatches> matches;
  std::set<camera_t> constant_cameras;  // intrinsics are not refined

  camera_t CameraIdOf(image_t id) const { return images.at(id).camera_id; }
  const Camera& CameraOf(image_t id) const { return cameras.at(CameraIdOf(id)); }
};

// In fewer photographs, intrinsics are hardly told from the poses, and move with chance.
inline constexpr int kEnoughToFind = 8;

// What every stage needs beside its data. One a run.
struct StageContext {
  const SceneData& scene;
  const ReconstructSettings& settings;
  RunContext run;
  RunReport& report;
  int model = 0;              // index of the model that is being built
  std::set<image_t> taken{};  // images of the models that are done
  // Images of other places that look like this one, which wait for a model of their own.
  std::set<image_t> reserved{};
  double min_angle_deg = TriangulationOptions().min_angle_deg;  // of points, see TrackAngles
  bool has_mostly_parallel_rays = false;
  // Cameras with the intrinsics that larger models of this run found, in kEnoughToFind images each.
  std::map<camera_t, Camera> found_cameras{};

  // The found cameras of which the model has fewer images, which hardly tell a focal length.
  std::set<camera_t> FoundCamerasOf(const Reconstruction& model) const;
  // Cameras of the model whose intrinsics are not refined, and others.
  std::set<camera_t> ConstantCameras(const Reconstruction& model) const {
    std::set<camera_t> cameras = FoundCamerasOf(model);
    cameras.insert(scene.constant_cameras.begin(), scene.constant_cameras.end());
    return cameras;
  }
};

// A stage of one model.
class ModelStage : public RunStage {
 public:
  ModelStage(StageContext& context, const std::string& name, int64_t total = 0)
      : RunStage(context.report, context.run.monitor, name, total) {
    Add("model", context.model);
  }
};

// A model that is being built, or done.
struct BuiltModel {
  std::optional<Reconstruction> model;  // absent: see the report's failure, or duplicate_edges
  ViewGraph graph;                      // with what became of the component's edges
  ModelEvidence evidence;
  std::vector<size_t> duplicate_edges;  // between two places that the model shows as one; removed
  double min_angle_deg = 0;
  std::vector<ResultWarning> warnings{};
  bool keeps_frame = false;  // that of an earlier model
};

}  // namespace cairn
