// Mueller matrix of a 2x2 amplitude matrix, row by row: Bohren & Huffman (1983), equation 3.16.
FORCE_INLINE double16 mueller(
    double S1r, double S1i, double S2r, double S2i, double S3r, double S3i, double S4r, double S4i) {
  const double n1 = S1r * S1r + S1i * S1i, n2 = S2r * S2r + S2i * S2i;
  const double n3 = S3r * S3r + S3i * S3i, n4 = S4r * S4r + S4i * S4i;
#define RE(a, b) (a##r * b##r + a##i * b##i) // Re(a b*)
#define IM(a, b) (a##i * b##r - a##r * b##i) // Im(a b*)
  const double16 m = (double16)(
      0.5 * (n1 + n2 + n3 + n4), 0.5 * (n2 - n1 + n4 - n3), RE(S2, S3) + RE(S1, S4), IM(S2, S3) - IM(S1, S4),
      0.5 * (n2 - n1 - n4 + n3), 0.5 * (n2 + n1 - n4 - n3), RE(S2, S3) - RE(S1, S4), IM(S2, S3) + IM(S1, S4),
      RE(S2, S4) + RE(S1, S3), RE(S2, S4) - RE(S1, S3), RE(S1, S2) + RE(S3, S4), IM(S2, S1) + IM(S4, S3),
      IM(S4, S2) + IM(S1, S3), IM(S4, S2) - IM(S1, S3), IM(S1, S2) - IM(S3, S4), RE(S1, S2) - RE(S3, S4));
#undef RE
#undef IM
  return m;
}
