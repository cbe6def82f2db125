#pragma once

#include <map>
#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

enum class ColmapModelFormat { kBinary, kText };

// Reads cameras, images and points3D of a COLMAP model folder: the .bin files where cameras.bin is
// there, else the .txt files. Quaternions are normalized, tracks sorted. Throws IoError that names
// the file (text: and the line) and the reason: absent, truncated, an unknown camera model, a
// repeated id, a reference to a missing camera, image or keypoint, a number that is not finite.
Reconstruction ReadColmapModel(const std::string& folder);

// Whether the folder holds such a model.
bool IsColmapModel(const std::string& folder);

// Writes the three files (in the order of the ids), creating the folder; COLMAP 3.8 reads them, and
// 4.x. Numbers in text files are the shortest that read back exactly, so write, read, write gives
// equal bytes in both formats (but for blanks around names, which text cannot hold). The files
// replace an older model of the same format (also the rigs and frames that COLMAP 4.x keeps beside
// them) only when all three are complete. Text files of an older model stay beside binary ones,
// which programs read first; text is not written beside binary files. Throws IoError, also where
// names are not unique or keypoints are not finite.
void WriteColmapModel(const Reconstruction& reconstruction, const std::string& folder,
                      ColmapModelFormat format = ColmapModelFormat::kBinary);

// What a command of cairn writes into a folder that the user names: a model, and other texts by the
// names of their files.
struct ColmapResult {
  std::string command;
  ColmapModelFormat format = ColmapModelFormat::kBinary;
  std::map<std::string, std::string> texts = {};
};

// WriteColmapModel into a folder that may hold other things. All files appear together, in place of
// those that an earlier run of the command left there, in either format. Throws ConfigError where a
// file that is not as this command wrote it would be replaced (unless `overwrites`), and where the
// folder has results of another command.
void WriteColmapResult(const Reconstruction& reconstruction, const std::string& folder,
                       const ColmapResult& result, bool overwrites = false);

}  // namespace cairn
