#pragma once

namespace cairn {

// Keys of cairn_stages, cairn_jobs and cairn_timings.
inline constexpr const char* kStageCameras = "cameras";
inline constexpr const char* kStageFeatures = "features";
inline constexpr const char* kStageDepth = "depth";
inline constexpr const char* kStageMatching = "matching";
inline constexpr const char* kStageVerification = "verification";

// Verifier name of poses that were imported from a 1DSfM data set.
inline constexpr const char* kImportedVerifier = "imported";

}  // namespace cairn
