#include "global_sfm/rotation_files.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/io/text_file.h"

namespace cairn {
namespace {

constexpr double kMaxNonOrthogonality = 1e-2;

// Reads the numbers of one line. std::from_chars: a file of megabytes is read in milliseconds.
class LineParser {
 public:
  LineParser(std::string_view line) : next_(line.data()), end_(line.data() + line.size()) {}

  template <class Number>
  bool Read(Number& value) {
    SkipBlanks();
    const auto [after, error] = std::from_chars(next_, end_, value);
    if (error != std::errc()) return false;
    next_ = after;
    return next_ == end_ || IsBlank(*next_);
  }
  bool AtEnd() {
    SkipBlanks();
    return next_ == end_;
  }

 private:
  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
  void SkipBlanks() {
    while (next_ != end_ && IsBlank(*next_)) ++next_;
  }

  const char* next_;
  const char* end_;
};

// What is wrong with the line, or "".
std::string ParseEdge(LineParser& parser, RotationEdge& edge) {
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> R;
  bool complete = parser.Read(edge.image_id1) && parser.Read(edge.image_id2);
  for (int k = 0; k < 9; ++k) complete = complete && parser.Read(R.data()[k]);
  if (!complete || !parser.AtEnd()) return "expected 'i j' and the 9 numbers of a rotation";
  if (edge.image_id1 == edge.image_id2) return "an edge from an image to itself";
  const double defect = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(defect < kMaxNonOrthogonality) || R.determinant() < 0) return "not a rotation matrix";
  edge.cam2_from_cam1 = Eigen::Quaterniond(Eigen::Matrix3d(R)).normalized();
  return "";
}

}  // namespace

std::vector<RotationEdge> ReadRelativeRotations(const std::string& path) {
  const std::string text = ReadTextFile(path);
  std::vector<RotationEdge> edges;
  size_t begin = 0;
  for (int line_number = 1; begin < text.size(); ++line_number) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line(text.data() + begin, end - begin);
    begin = end + 1;
    LineParser parser(line);
    if (line.starts_with('#') || parser.AtEnd()) continue;
    edges.emplace_back();
    const std::string problem = ParseEdge(parser, edges.back());
    if (!problem.empty()) throw IoError(path + ":" + std::to_string(line_number), problem);
  }
  return edges;
}

void WriteRotations(const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
                    const std::string& path) {
  std::string text;
  char number[32];
  for (const auto& [image_id, rotation] : cam_from_world) {
    text += std::to_string(image_id);
    const Eigen::Matrix3d R = rotation.toRotationMatrix();
    for (int k = 0; k < 9; ++k) {
      text += ' ';
      text.append(number, std::to_chars(number, number + sizeof(number), R(k / 3, k % 3)).ptr);
    }
    text += '\n';
  }
  WriteFileAtomically(path, text);
}

}  // namespace cairn
