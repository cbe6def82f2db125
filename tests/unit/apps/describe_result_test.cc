#include "global_sfm/describe_result.h"

#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

std::string Describe(const std::vector<ResultWarning>& warnings) {
  ReconstructResult result;
  result.models.push_back(MakeSyntheticScene({}).truth);
  for (const auto& [id, image] : result.models[0].images) result.images.push_back(image.image);
  result.report.warnings = warnings;
  return DescribeResult(result, "out", kOneThread);
}

// What is wrong with a model is said in the last lines, with what to do.
TEST(DescribeResult, SaysAllWarningsWithTheirAdvice) {
  EXPECT_THAT(Describe({}), HasSubstr("warnings     none\n"));
  const std::string text = Describe({{"it is bent", "give its camera"}, {"it was cut", ""}});
  EXPECT_THAT(text, HasSubstr("warnings     it is bent; give its camera\n"
                              "             it was cut\n"));
}

TEST(DescribeResult, OfManyWarningsSaysFiveAndHowManyMore) {
  std::vector<ResultWarning> warnings;
  for (int i = 0; i < 7; ++i) warnings.push_back({"doubt " + std::to_string(i), ""});
  const std::string text = Describe(warnings);
  EXPECT_THAT(text, HasSubstr("             doubt 4\n             and 2 more\n"));
  EXPECT_THAT(text, Not(HasSubstr("doubt 5")));
}

}  // namespace
}  // namespace cairn
