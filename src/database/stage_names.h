#pragma once

#include <string>

namespace cairn {

// Keys of cairn_stages, cairn_jobs and cairn_timings.
inline const std::string kStageCameras = "cameras";
inline const std::string kStageFeatures = "features";
inline const std::string kStageDepth = "depth";
inline const std::string kStagePairs = "pairs";
inline const std::string kStageMatching = "matching";
inline const std::string kStageVerification = "verification";

// Import of a 1DSfM data set without photographs.
inline const std::string kStageDataset = "dataset";

// Note of a job of the stage "cameras": the image is to get a new camera.
inline const std::string kPendingCamera = "pending";

// Verifier name of poses that were imported from a 1DSfM data set.
inline const std::string kImportedVerifier = "imported";

}  // namespace cairn
