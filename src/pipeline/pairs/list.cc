#include <map>
#include <optional>

#include "cairn/base/error.h"
#include "cairn/pipeline/stages.h"
#include "database/stage_names.h"
#include "io/text_reader.h"
#include "math/sorted_order.h"
#include "report/stage.h"

namespace cairn {
namespace {

// Names may contain blanks, so the line is split where both parts are names of images.
std::optional<std::pair<std::string, std::string>> SplitLine(
    const std::string& line, const std::map<std::string, image_t>& ids) {
  std::optional<std::pair<std::string, std::string>> first;
  for (size_t end = line.find_first_of(" \t"); end != std::string::npos;
       end = line.find_first_of(" \t", line.find_first_not_of(" \t", end))) {
    const size_t begin = line.find_first_not_of(" \t", end);
    std::pair<std::string, std::string> names(line.substr(0, end), line.substr(begin));
    if (ids.contains(names.first) && ids.contains(names.second)) return names;
    if (!first) first = std::move(names);
  }
  return first;
}

}  // namespace

std::vector<image_pair_t> ReadPairList(const std::string& path, const std::vector<Image>& images,
                                       ProgressMonitor& monitor) {
  TextReader reader(path);
  std::map<std::string, image_t> ids;
  for (const Image& image : images) ids[image.name] = image.image_id;
  std::vector<image_pair_t> pairs;
  std::vector<std::string> skipped;
  while (reader.NextDataLine()) {
    const std::string line(reader.Rest());
    const std::string where = path + ":" + std::to_string(reader.line_number());
    const auto names = SplitLine(line, ids);
    if (!names) reader.Fail("'" + line + "' is not two image names");
    const auto id1 = ids.find(names->first);
    const auto id2 = ids.find(names->second);
    if (id1 == ids.end() || id2 == ids.end()) {
      skipped.push_back(where + ": no image '" + (id1 == ids.end() ? names->first : names->second) +
                        "' in the database; the pair is skipped");
    } else if (id1->second == id2->second) {
      skipped.push_back(where + ": '" + names->first + "' paired with itself; skipped");
    } else {
      pairs.push_back(ImagePairToPairId(id1->second, id2->second));
    }
  }
  Stage(monitor, kStagePairs).WarnEach(skipped);
  if (pairs.empty()) throw IoError(path, "names no pair of photographs of the database");
  return Unique(std::move(pairs));
}

}  // namespace cairn
