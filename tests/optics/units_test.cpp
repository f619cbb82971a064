#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <functional>
#include <string>

namespace {

using scatter::InputError;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// The message of the InputError that the call throws.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  ADD_FAILURE() << "not refused";
  return {};
}

TEST(Length, OfWholeNanometresIsTheNearestDouble) {
  EXPECT_EQ(scatter::parse_length("0.4mm"), 0.4e-3);
  EXPECT_EQ(scatter::parse_length("650nm"), 650e-9);
  EXPECT_DOUBLE_EQ(scatter::parse_length("589.3nm"), 589.3e-9); // two roundings
  EXPECT_EQ(scatter::parse_length("5um"), 5e-6);
  EXPECT_EQ(scatter::parse_length("1e-3m"), 1e-3);
  EXPECT_EQ(scatter::parse_length("+2cm"), 0.02);
  EXPECT_EQ(scatter::parse_length(".5mm"), 0.5e-3);
}

TEST(Length, TakesBothMicroSigns) {
  EXPECT_EQ(scatter::parse_length("5\xC2\xB5m"), 5e-6);
  EXPECT_EQ(scatter::parse_length("5\xCE\xBCm"), 5e-6);
}

TEST(Length, NeedsAUnitAndSaysWhichThereAre) {
  EXPECT_THAT(
      refusal([] { (void)scatter::parse_length("0.4"); }),
      AllOf(HasSubstr("\"0.4\""), HasSubstr("no unit"), HasSubstr("0.4mm"), HasSubstr("nm")));
  EXPECT_THAT(
      refusal([] { (void)scatter::parse_length("0.4parsec"); }),
      AllOf(HasSubstr("\"0.4parsec\""), HasSubstr("unknown unit \"parsec\""), HasSubstr("mm")));
}

TEST(Length, IsGreaterThanZero) {
  EXPECT_THAT(refusal([] { (void)scatter::parse_length("-1mm"); }), HasSubstr("greater than zero"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_length("0mm"); }), HasSubstr("greater than zero"));
}

TEST(Angle, IsInDegreesUnlessAUnitSaysOtherwise) {
  EXPECT_EQ(scatter::parse_angle_deg("20"), 20);
  EXPECT_EQ(scatter::parse_angle_deg("20deg"), 20);
  EXPECT_EQ(scatter::parse_angle_deg("-20.5deg"), -20.5);
  EXPECT_EQ(scatter::parse_angle_deg("30arcmin"), 0.5);
  EXPECT_EQ(scatter::parse_angle_deg("1800arcsec"), 0.5);
  EXPECT_DOUBLE_EQ(scatter::parse_angle_deg("1rad"), 57.295779513082320877);
  EXPECT_THAT(refusal([] { (void)scatter::parse_angle_deg("1gon"); }), HasSubstr("arcmin"));
}

TEST(Number, IsPlainAndFinite) {
  EXPECT_EQ(scatter::parse_number("1e-3"), 1e-3);
  EXPECT_EQ(scatter::parse_number("-7"), -7);
  EXPECT_THAT(refusal([] { (void)scatter::parse_number("1mm"); }), HasSubstr("\"mm\""));
}

TEST(EveryQuantity, RefusesWhatIsNotAFiniteNumber) {
  for (const std::string text :
       {"",     " ",  "x",  "nan", "-nan", "inf", "-inf",  "infinity", "1e999", "1e-999", "++1", "+-1",
        "0x10", "1 ", " 1", "1,",  "1e",   "--1", "1.2.3", ".",        "+",     "-",      "e5"}) {
    EXPECT_THROW((void)scatter::parse_number(text), InputError) << text;
    EXPECT_THROW((void)scatter::parse_angle_deg(text), InputError) << text;
    EXPECT_THROW((void)scatter::parse_angle_deg(text + "deg"), InputError) << text;
    EXPECT_THROW((void)scatter::parse_length(text + "mm"), InputError) << text;
    EXPECT_THROW((void)scatter::parse_lengths(text + "mm"), InputError) << text;
    EXPECT_THROW((void)scatter::parse_index(text), InputError) << text;
  }
  EXPECT_THROW((void)scatter::parse_length("1e-320nm"), InputError);
  EXPECT_THROW((void)scatter::parse_angle_deg("1.7e308rad"), InputError);
}

TEST(EveryQuantity, ReadsTheSameInAnyLocale) {
  const char* const before = std::setlocale(LC_ALL, nullptr);
  const std::string saved = before;
  for (const char* const name : {"de_DE.UTF-8", "fr_FR.UTF-8", "C.UTF-8"}) {
    if (!std::setlocale(LC_ALL, name)) continue; // not installed: C.UTF-8 always is
    EXPECT_EQ(scatter::parse_length("0.4mm"), 0.4e-3) << name;
    EXPECT_THROW((void)scatter::parse_length("0,4mm"), InputError) << name;
  }
  std::setlocale(LC_ALL, saved.c_str());
}

TEST(Range, UnitAtTheEndHoldsForAll) {
  EXPECT_THAT(scatter::parse_lengths("380:400:10nm"), ElementsAre(380e-9, 390e-9, 400e-9));
  EXPECT_THAT(scatter::parse_lengths("380nm:400nm:10nm"), ElementsAre(380e-9, 390e-9, 400e-9));
  EXPECT_THAT(scatter::parse_angles_deg("0:1:0.5"), ElementsAre(0, 0.5, 1));
  EXPECT_THAT(scatter::parse_angles_deg("0:60:30arcmin"), ElementsAre(0, 0.5, 1));
  EXPECT_THAT(refusal([] { (void)scatter::parse_lengths("0.38um:700nm:10nm"); }), HasSubstr("mixes units"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_lengths("380nm:700nm:10"); }), HasSubstr("no unit"));
}

TEST(Range, IncludesItsLastValueWhenTheStepsMeetIt) {
  EXPECT_THAT(scatter::parse_angles_deg("0:0.3:0.1"), ElementsAre(0, 0.1, 0.2, 0.3));
  EXPECT_THAT(scatter::parse_angles_deg("0:1:0.4"), ElementsAre(0, 0.4, 0.8));
  EXPECT_THAT(scatter::parse_angles_deg("5:5:1"), ElementsAre(5));
  const auto theta = scatter::parse_angles_deg("0:180:0.0125deg");
  ASSERT_EQ(theta.size(), 14401u);
  EXPECT_EQ(theta.back(), 180);
}

TEST(Range, ValuesAreTheDoublesNearestToTheDecimals) {
  const auto theta = scatter::parse_angles_deg("0:180:0.1");
  ASSERT_EQ(theta.size(), 1801u);
  for (std::size_t i = 0; i < theta.size(); ++i) EXPECT_EQ(theta[i], static_cast<double>(i) / 10);
}

TEST(Range, NeverPassesItsLastValueAndAlwaysIncreases) {
  for (const char* const text :
       {"0:180:0.0125", "0:1:0.3", "1:2:0.1", "0:180:0.7", "-360:360:0.9", "0:1:0.333333333333"}) {
    const auto values = scatter::parse_angles_deg(text);
    for (std::size_t i = 1; i < values.size(); ++i)
      ASSERT_LT(values[i - 1], values[i]) << text << " at " << i;
    const std::string whole(text);
    const auto colon = whole.find(':');
    EXPECT_LE(values.back(), std::stod(whole.substr(colon + 1))) << text;
  }
}

TEST(Range, RefusesWhatHasNoValuesOrTooMany) {
  EXPECT_THAT(
      refusal([] { (void)scatter::parse_lengths("700:380:10nm"); }), HasSubstr("ends before it starts"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_lengths("380:700:0nm"); }), HasSubstr("step"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_lengths("380:700:-10nm"); }), HasSubstr("step"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_angles_deg("0:180:1e-9"); }), HasSubstr("10 million"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_angles_deg("0:9e6:1,0:9e6:1"); }), HasSubstr("10 million"));
  EXPECT_THAT(
      refusal([] { (void)scatter::parse_angles_deg("-1.7e308:1.7e308:1"); }), HasSubstr("10 million"));
  EXPECT_THAT(
      refusal([] { (void)scatter::parse_angles_deg("1e20:1.00000000000001e20:1"); }), HasSubstr("too small"));
  EXPECT_THAT(refusal([] { (void)scatter::parse_lengths("0:700:10nm"); }), HasSubstr("greater than zero"));
}

TEST(Range, RefusesWhatIsNotOfThreeParts) {
  for (const char* const text :
       {"380:700nm", "380:700:10:5nm", ":", "::", ":::nm", "380::10nm", "380:700:nm", "380:nan:10nm",
        "380:700:infnm", "380:700:10nmx", "380x:700:10nm", "a:b:c"}) {
    EXPECT_THROW((void)scatter::parse_lengths(text), InputError) << text;
    EXPECT_THROW((void)scatter::parse_angles_deg(text), InputError) << text;
  }
}

TEST(List, KeepsTheOrderWritten) {
  EXPECT_THAT(scatter::parse_lengths("400nm,0.5um"), ElementsAre(400e-9, 0.5e-6));
  EXPECT_THAT(scatter::parse_angles_deg("138.5,137"), ElementsAre(138.5, 137));
  EXPECT_THAT(scatter::parse_angles_deg("90"), ElementsAre(90));
  EXPECT_THAT(scatter::parse_angles_deg("0:2:1,10"), ElementsAre(0, 1, 2, 10));
}

TEST(List, RefusesEmptyPlaces) {
  for (const char* const text : {"", ",", "1deg,", ",1deg", "1deg,,2deg"})
    EXPECT_THAT(refusal([text] { (void)scatter::parse_angles_deg(text); }), HasSubstr("empty")) << text;
}

TEST(Orders, AreSortedWithoutRepeats) {
  EXPECT_THAT(scatter::parse_orders("3"), ElementsAre(3));
  EXPECT_THAT(scatter::parse_orders("2,0"), ElementsAre(0, 2));
  EXPECT_THAT(scatter::parse_orders("0..3"), ElementsAre(0, 1, 2, 3));
  EXPECT_THAT(scatter::parse_orders("2..4,3,0"), ElementsAre(0, 2, 3, 4));
  EXPECT_EQ(scatter::parse_orders("0..1000").size(), 1001u);
}

TEST(Orders, RefuseWhatIsNotZeroToThousand) {
  for (const char* const text :
       {"", ",", "-1", "1001", "99999999999999999999", "3..0", "0...3", "..3", "0..", "1.5", "0:3", "a",
        "0..3..5", "+1", "1 "})
    EXPECT_THROW((void)scatter::parse_orders(text), InputError) << text;
}

TEST(Index, IsRealOrComplex) {
  EXPECT_EQ(scatter::parse_index("1.331"), std::complex<double>(1.331, 0));
  EXPECT_EQ(scatter::parse_index("1.33+1e-9i"), std::complex<double>(1.33, 1e-9));
  EXPECT_EQ(scatter::parse_index("1e0+0i"), std::complex<double>(1, 0));
  EXPECT_EQ(scatter::parse_index("0.75"), std::complex<double>(0.75, 0));
  EXPECT_FALSE(std::signbit(scatter::parse_index("1.33-0i").imag()));
}

TEST(Index, RefusesGainAndWhatIsNotAnIndex) {
  EXPECT_THAT(refusal([] { (void)scatter::parse_index("1.33-1e-9i"); }), HasSubstr("k < 0"));
  for (const char* const text :
       {"0", "-1.33", "1e-9i", "1.33i", "1.33+i", "1.33+-1e-9i", "1.33++1e-9i", "1.33+1e-9", "1.33+1e-9j",
        "1.33+1e-9ii", "1.33+nani", "nan+0i", "1.33,0", "1.33 + 1i", "1.33+"})
    EXPECT_THROW((void)scatter::parse_index(text), InputError) << text;
}

TEST(Message, IsOneLineThatQuotesTheText) {
  const std::string text = "12\n\x1b[31m" + std::string(500, 'x');
  const std::string message = refusal([&text] { (void)scatter::parse_length(text); });
  EXPECT_THAT(
      message,
      AllOf(HasSubstr("\"12??[31m"), Not(HasSubstr("\n")), Not(HasSubstr("\x1b")), HasSubstr("...")));
  EXPECT_LT(message.size(), 300u);
}

TEST(Message, DoesNotCutACharacterInHalf) {
  std::string text;
  for (int i = 0; i < 50; ++i) text += "\xC2\xB5";
  const std::string shown = scatter::quote("x" + text);
  EXPECT_EQ(shown.substr(shown.size() - 6), "\xC2\xB5...\"");
}

} // namespace
